"""Targets, tools and frames of UR scripts, and what is written back."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.errors import FormatError, ShapeError
from robotrue.program.formats import detect
from robotrue.program.formats.urscript_write import nearest_rotation_vector
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Program, Reason, Replacement

P = "p[0.100000, -0.200000, 0.300000, 3.114716, 0.410060, 0.000000]"
Q = "[0.174533,-1.221730,1.745329,0.087266,1.047198,-0.349066]"
NONE, AXES, EXPRESSION = int(Reason.NONE), int(Reason.JOINT_TARGET), int(Reason.EXPRESSION)
UNKNOWN, UNUSED = int(Reason.UNKNOWN_FRAME), int(Reason.UNUSED)


def read(text: str, frames: FrameTable | None = None) -> Program:
    return find_language("urscript").read(
        text.encode("latin-1"), name="part.script", frames=frames or FrameTable()
    )


def script(text: str, frames: FrameTable | None = None) -> Program:
    return read(f"def part():\n{text}\nend\npart()\n", frames)


def reasons(text: str) -> list[int]:
    return [int(each) for each in script(text).reason]


def change(
    program: Program, *, by_m: float = 0.0, turn: np.ndarray | None = None, axes: float = 0.0
) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (NONE, AXES)),
        position=program.position + by_m,
        rotation=program.rotation @ (np.eye(3) if turn is None else turn),
        axes=program.axes + axes,
        words=program.words,
    )


def lines(program: Program, what: Replacement) -> list[str]:
    out = find_language("urscript").write(program, what).decode("latin-1").splitlines()
    before = program.data.decode("latin-1").splitlines()
    return [new for old, new in zip(before, out, strict=True) if old != new]


def test_detected_by_content() -> None:
    assert detect(f"movel({P},a=1.2)".encode(), "noname").name == "urscript"
    assert detect(b"def f():\n  set_tcp(tool)\nend\n", "noname").name == "urscript"
    assert detect(b"whatever", "x.script").name == "urscript"
    python = b"import urx\ndef f():\n    movel(p[0,0,0,0,0,0])\n    rob.movel([1])\n"
    assert find_language("urscript").detect(python) < 0.4
    assert find_language("urscript").detect(b"def f():\n    rob.movel(x)\n") < 0.4


def test_every_motion() -> None:
    program = script(
        f"movel({P},1,0.1)\nmovep(pose={P}, a=1)\nmovej({P})\nmovec({P},{P},1,0.1,0,mode=1)\n"
        f"movej({Q})\nmovel({Q})\nmovej(get_inverse_kin({P}, qnear={Q}), a=1)\n"
    )
    motions = [Motion.LIN, Motion.LIN, Motion.PTP, Motion.ARC_VIA, Motion.ARC_END]
    assert program.motion.tolist() == [*motions, Motion.PTP, Motion.LIN, Motion.PTP]
    assert program.reason.tolist() == [0, 0, 0, 0, 0, AXES, AXES, 0]
    np.testing.assert_allclose(program.position[0], [0.1, -0.2, 0.3])
    np.testing.assert_allclose(
        program.rotation[0], matrix_from_rotation_vector(np.array([3.114716, 0.41006, 0.0]))
    )
    np.testing.assert_allclose(program.axes[5][:2], [0.174533, -1.22173])
    assert program.line.tolist() == [2, 3, 4, 5, 5, 6, 7, 8]


def test_tool_in_the_order_of_the_script() -> None:
    given = np.eye(4)
    given[2, 3] = 0.5
    two = "set_tcp(p[0,0,0.2,0,0,0])\n"
    frames = FrameTable(T_flange_tool=given, T_base_frame=given)
    program = script(
        f"movel({P})\n{two}movel({P})\nt=p[0,0,0.3,0,0,0]\nset_tcp(t)\nmovel({P})", frames
    )
    assert program.T_flange_tool[program.tool][:, 2, 3].tolist() == [0.5, 0.2, 0.3]
    # A pose is in the robot's base, whatever the cell's work frame is.
    np.testing.assert_array_equal(program.T_base_frame[program.frame[0]], np.eye(4))
    assert len(program) == 3
    assert reasons(f"if x:\n{two}end\nmovel({P})\n{two}movel({P})") == [UNKNOWN, NONE]
    assert reasons(f"while x:\nmovel({P})\n{two}end") == [UNKNOWN]
    assert reasons(f"if x:\n{two}else:\n{two}end\nmovel({P})") == [NONE]
    assert reasons(f"set_tcp(get_tcp_offset())\nmovel({P})") == [UNKNOWN]
    assert reasons(f"def tool():\n{two}end\ntool()\nmovel({P})") == [NONE]
    note = script(f"set_tcp(x)\nmovel({P})").notes[0]
    assert note.startswith("part.script:2: the tool of line 2 is computed")


def test_a_thread_that_changes_the_tool_is_told() -> None:
    program = read(f"thread t():\nset_tcp({P})\nend\ndef a():\nmovel({P})\nend\n")
    assert program.reason.tolist() == [NONE]
    assert any("the thread t changes the tool" in note for note in program.notes)
    text = "set_tcp(p[0,0,0.1,0,0,0])\nthread t():\nset_tcp(p[0,0,0.2,0,0,0])\nend\nrun t()\n"
    started = script(f"{text}s=struct(a=1)\nmovel({P})")
    assert started.reason.tolist() == [NONE]
    assert started.T_flange_tool[started.tool[0], 2, 3] == 0.1  # as if it did not run


@pytest.mark.parametrize(
    ("body", "z_mm"),
    [
        ("if f():\nM\nelse:\nM\nend\nM", [200, 200, 200]),
        ("if x:\nM\nelif f():\nM\nelse:\nM\nend\nM", [0, 200, 200, None]),
        ("while f():\nM\nset_tcp(p[0,0,0,0,0,0])\nend\n", [200]),
        ("if x and f():\nM\nend\nM", [None, None]),  # not called where it does not decide
    ],
)
def test_functions_in_conditions_set_the_tool_on_all_ways(
    body: str, z_mm: list[int | None]
) -> None:
    text = f"set_tcp(p[0,0,0,0,0,0])\n{body}".replace("M", f"movel({P})")
    function = "def f():\n  set_tcp(p[0,0,0.2,0,0,0])\n  return True\nend\n"
    program = read(f"{function}def part():\n{text}\nend\npart()\n")
    z = program.T_flange_tool[program.tool][:, 2, 3] * 1e3
    unknown = program.reason == UNKNOWN
    assert [None if lost else round(a) for lost, a in zip(unknown, z.tolist(), strict=True)] == z_mm


def test_frames() -> None:
    frame = "p[1.0,2.0,0.0,0.0,0.0,1.5707963]"
    program = script(f"movel(pose_trans({frame}, {P}))\nf = {frame}\nmovej(pose_trans(f,{P}),a=1)")
    assert program.reason.tolist() == [NONE, NONE]
    assert program.frame[0] == program.frame[1]
    np.testing.assert_allclose(program.T_base_frame[program.frame[0]][:3, 3], [1, 2, 0])
    np.testing.assert_allclose(program.T_base_frame[program.frame[0]][1, 0], 1.0)
    np.testing.assert_allclose(program.position[0], [0.1, -0.2, 0.3])
    assert reasons(f"movel(pose_trans(get_actual_tcp_pose(),{P}))") == [UNKNOWN]
    assert reasons(f"movel(pose_trans({P},pose_trans({P},{P})))") == [UNKNOWN]
    two = f"p1={P}\nmovel(p1)\nmovel(pose_trans({frame},p1))"
    assert reasons(two) == [UNKNOWN]
    assert reasons(f"f={frame}\nmovel(f)\nmovel(pose_trans(f,{P}))") == [EXPRESSION, NONE]


def test_variables() -> None:
    assert reasons(f"global p1={P}\np2 = {P}\nq1={Q}\nmovel(p1,a=1)\nmovej(q1)") == [
        NONE,
        UNUSED,
        AXES,
    ]
    assert reasons(f"p1={P}\nmovel(p1)\np1={P}\nmovel(p1)") == [NONE, NONE]
    assert reasons(f"p1={P}\nif x:\np1={P}\nend\nmovel(p1)") == [UNUSED, EXPRESSION]
    for change_ in ("p1[2]=0.5", "p1=pose_add(p1,p2)", "use(p1)", "q=get_inverse_kin(p1)"):
        assert reasons(f"p1={P}\nmovel(p1)\n{change_}") == [EXPRESSION]
    text = f"def go(p1):\nmovel(p1)\nend\np1={P}\nmovel(p1)"
    assert reasons(text) == [EXPRESSION, NONE]


def test_what_is_refused_target_by_target() -> None:
    program = script(
        f"movel(pose_add(p1,{P}))\nmovel(p[x,0,0,0,0,0])\nmovej([0,0,d2r(5),0,0,0])\nmovel(ghost)"
    )
    assert program.reason.tolist() == [int(Reason.RELATIVE), *[EXPRESSION] * 3]
    assert program.notes[0].startswith("part.script:2: the target 'pose_add(p1,")
    for tool in (f"{Q},1e-3,1e-3,{P}", f"tcp={P}"):
        assert reasons(f"movej(get_inverse_kin({P},{tool}))") == [EXPRESSION]
    assert reasons(f"movec({P},ghost)") == [EXPRESSION, EXPRESSION]
    assert reasons("movec(ghost)") == [EXPRESSION, int(Reason.INCOMPLETE)]
    assert reasons(f"servoc({P},1,1)") == [EXPRESSION]
    assert reasons(f"movel({P.replace('0.1', '1E999')})") == [int(Reason.INCOMPLETE)]


def test_comments_strings_and_long_statements() -> None:
    program = script(
        f'  textmsg("movel({P}) # (")  # movel({P}\n'
        "  movel( p[ .1 ,-0.2,\n  +0.3, # x\n 0,0,0 ]\n, a=1)\n#("
    )
    assert program.line.tolist() == [3]
    np.testing.assert_allclose(program.position, [[0.1, -0.2, 0.3]])


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("x = 1\n", 1, "no 'def' and no motion"),
        ("def a():\nif x:\nend\n", 1, "the 'def' has no 'end'"),
        ("def a():\nend\nend\n", 3, "'end' without"),
        ("def a():\nmovel(p[1,2\nend\n", 2, "a bracket is not closed"),
        ("def a():\nmovel(1))\nend\n", 2, "a bracket is closed"),
        ("def a():\n\0end\n", 2, "NUL"),
    ],
)
def test_refused_by_line(text: str, line: int, what: str) -> None:
    with pytest.raises(FormatError, match=what) as caught:
        read(text)
    assert (caught.value.line, caught.value.source) == (line, "part.script")


def test_a_shift_changes_only_its_numbers() -> None:
    text = f"set_tcp({P})\nf={P}\nmovel({P},0.1,0.2)\nmovel(pose_trans(f,p[1,.5,-0.25,0,0,0]))"
    program = script(text)
    assert lines(program, change(program)) == []
    assert lines(program, change(program, by_m=1.5e-5)) == [
        "movel(p[0.100015, -0.199985, 0.300015, 3.114716, 0.410060, 0.000000],0.1,0.2)",
        "movel(pose_trans(f,p[1.0000150,.5000150,-0.2499850,0,0,0]))",
    ]
    axes = script(f"movej({Q})")
    assert lines(axes, change(axes, axes=1e-4))[0].startswith("movej([0.174633,-1.221630,")


def test_half_a_turn_keeps_its_vector() -> None:
    turn = matrix_from_rotation_vector(np.array([0.0, 2e-3, 0.0]))
    for x in (3.14159, -3.14159, 3.1425, 6.2):
        program = script(f"movel(p[0,0,0,{x:.6f},0.000000,0.000000])")
        (line,) = lines(program, change(program, turn=turn))
        again = script(line)
        np.testing.assert_allclose(again.rotation, program.rotation @ turn, atol=2e-6)
        assert abs(again.spans.numbers.value[0, 3] - x) < 0.1
    near = np.array([[0.0, 0.0, 2 * np.pi]])
    np.testing.assert_allclose(nearest_rotation_vector(np.eye(3)[None], near), near)


def test_values_that_cannot_be_written() -> None:
    program = script(f"movel({P})")
    with pytest.raises(ShapeError, match=r"part\.script:2: the new target is .*nan"):
        find_language("urscript").write(program, change(program, by_m=float("nan")))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"movej({P}); movel({P})", [NONE, EXPRESSION]),
        (f"if x: movel({P})\nend", [EXPRESSION]),
        (f"optimovel({P}, a=0.3)\nmovel({P})", [EXPRESSION, NONE]),
        (f"x = servoj({P})", [EXPRESSION]),
        (f"remove_it = 1\nmovel({P}, r=remove_it)", [NONE]),
        (f"movel({P})\ntrack_conveyor_linear({P}, 2)\nmovej({Q})", [EXPRESSION] * 2),
    ],
)
def test_motions_that_are_not_followed_are_told(text: str, expected: list[int]) -> None:
    program = script(text)
    assert [int(each) for each in program.reason] == expected
    told = any("is not followed" in note or "conveyor" in note for note in program.notes)
    assert told == (EXPRESSION in expected)


def test_a_routine_of_the_script_that_is_called_like_a_motion() -> None:
    text = f"def move_to(q):\n  movej(q)\nend\ndef part():\n  move_to({Q})\n  movel({P})\nend\n"
    program = read(text)
    assert NONE in program.reason
    assert not any("move_to is not followed" in note for note in program.notes)


def test_a_function_in_no_script_may_set_the_tool() -> None:
    text = f"movel({P})\nrq_close(1)\nmovel({P})\nset_tcp({P})\nmovel({P})"
    assert reasons(text) == [NONE, UNKNOWN, NONE]
    assert script(text).notes == (
        "part.script:3: rq_close is in no file given and may change the tool: 1 targets behind "
        "it are not compensated, until set_tcp. Give its file, too; if it changes none of them, "
        'state in the cell: [controller] harmless_routines = ["rq_close"].',
    )
    stored = script(f"p1={P}\nmovel(p1)\nrq_close(1)\nmovel(p1)")
    assert stored.reason.tolist() == [UNKNOWN]
    assert any("rq_close is in no file given" in note for note in stored.notes)
    known = FrameTable(harmless_routines=("rq_close",))
    assert script(text, known).reason.tolist() == [NONE] * 3
    own = "sleep(0.1)\nset_digital_out(1, True)\nif (get_digital_in(1) and x.go(2)):\nend\n"
    assert reasons(f"{own}movel({P})") == [NONE]


def test_a_local_variable_of_the_program_is_that_of_its_routines() -> None:
    text = f"local p1={P}\ndef sub():\nmovel(pose_add(p1,{P}))\nend\nsub()\nmovel(p1)"
    assert reasons(text) == [EXPRESSION, int(Reason.RELATIVE)]


def test_statements_after_a_motion_in_its_line() -> None:
    text = f"movel({P}, a=1); set_tcp({P})\nmovel({P})"
    assert reasons(text) == [NONE, UNKNOWN]
    assert reasons(f"movel({P}); sleep(1)\nmovel({P})") == [NONE, NONE]


def test_runs_of_motions_end_where_word_or_frame_changes() -> None:
    f, moved = "f=p[1,0,0,0,0,0]", P.replace("0.1", "0.2")
    program = script(
        f"{f}\nmovel({P})\nmovel({moved})  # x\nmovej({P})\nmovel(pose_trans(f, {P}), a=1)\n"
        f"movel(pose_trans(f, {moved}))\nmovel(pose_trans(p[2,0,0,0,0,0], {P}))\n"
        f"f = p[3,0,0,0,0,0]\nmovel(pose_trans(f, {P}))"
    )
    moves = program.motion != Motion.UNUSED
    assert program.motion[moves].tolist() == [Motion.LIN] * 2 + [Motion.PTP] + [Motion.LIN] * 4
    frame = program.T_base_frame[program.frame[moves], 0, 3]
    np.testing.assert_array_equal(frame, [0, 0, 0, 1, 1, 2, 3])
    assert program.position[moves, 0].tolist() == [0.1, 0.2, 0.1, 0.1, 0.2, 0.1, 0.1]
