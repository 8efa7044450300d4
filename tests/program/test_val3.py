"""VAL3 applications: what is read of them, what is written, and what is left alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from val3_samples import BODY, DTX, PJX, pgx, read_points

from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import pose
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError, ShapeError
from robotrue.program.controller_frames import controller_frame, controller_tool
from robotrue.program.formats import detect, read_job, write_program
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Motion, Program, Reason, Replacement

NONE, JOINT = Reason.NONE, Reason.JOINT_TARGET
READ, UNKNOWN = Reason.EXPRESSION, Reason.UNKNOWN_FRAME


def turn(rx: float, ry: float, rz: float) -> np.ndarray:
    """About x, then the new y, then the new z."""
    return Rotation.from_euler("XYZ", [rx, ry, rz], degrees=True).as_matrix()


def move_by(program: Program, shift_m: float, turn_deg: float = 0.0) -> Replacement:
    R = program.rotation @ turn(turn_deg, -turn_deg, 2.0 * turn_deg)
    return Replacement(
        changed=program.reason == NONE, position=program.position + shift_m, rotation=R,
        axes=program.axes, words=np.full_like(program.words, NO_WORD),
    )  # fmt: skip


def test_points_frames_and_tools_are_read() -> None:
    program = read_points()
    reasons = [NONE, NONE, NONE, NONE, Reason.UNUSED, JOINT]
    assert program.reason.tolist() == reasons
    motions = [Motion.PTP, Motion.LIN, Motion.ARC_VIA, Motion.ARC_END, Motion.UNUSED, Motion.PTP]
    assert program.motion.tolist() == motions
    assert program.position[1] / MM == pytest.approx([110, 5, 50.25])
    assert program.position[2] / MM == pytest.approx([120, 6, 51])
    assert program.rotation[1] == pytest.approx(turn(10, -20, 30))
    assert program.rotation[2] == pytest.approx(turn(3, 2, 1))
    cell = pose(turn(10, 20, 30), np.array([0.5, -0.1005, 0.02]))
    bases = program.T_base_frame[program.frame]
    assert bases[0] == pytest.approx(cell @ pose(turn(0, 0, 90), np.array([0, 0, 7e-3])))
    assert bases[2] == pytest.approx(cell)
    assert bases[3] == pytest.approx(np.eye(4))
    tool = program.T_flange_tool[program.tool[0]]
    assert tool == pytest.approx(pose(turn(0, 90, 0), np.array([0, 0, 0.15])))
    assert program.axes[5] / DEG == pytest.approx([0, 10, 90, 0, 30, 0])
    assert program.line.tolist() == [19, 20, 21, 22, 25, 28]
    assert program.path[:, 1].tolist() == [5, 0, 1, 2, 3]
    assert any("shoulder, elbow and wrist" in note for note in program.notes)


def test_zero_correction_keeps_every_byte_and_undo_is_the_identity() -> None:
    program = read_points()
    assert write_program(program, move_by(program, 0.0)) == DTX.encode()
    out = write_program(program, move_by(program, 3.1e-4, 0.05)).decode()
    again = read_points(dtx=out)
    assert np.abs(again.position - move_by(program, 3.1e-4).position)[:4].max() <= 0.51e-6
    wanted = move_by(program, 0.0, 0.05).rotation[:4]
    assert np.abs(again.rotation[:4] - wanted).max() < 2e-3 * DEG
    back = Replacement(
        changed=program.reason == NONE, position=program.position, rotation=program.rotation,
        axes=program.axes, words=program.words,
    )  # fmt: skip
    home = read_points(dtx=write_program(again, back).decode())
    assert np.abs(home.position - program.position)[:4].max() <= 0.51e-6
    strip = re.compile(r'(?<=[ "])r?[xyz]="[^"]*"|(?<=[ "])r?[xyz]=\'[^\']*\'')
    lines = list(zip(DTX.splitlines(), out.splitlines(), strict=True))
    assert [k for k, (a, b) in enumerate(lines, 1) if a != b] == [19, 20, 21, 22]
    assert all(strip.sub("", a) == strip.sub("", b) for a, b in lines)
    assert "x='130.310'" in out


def test_a_value_that_cannot_be_written_is_refused() -> None:
    program = read_points()
    with pytest.raises(ShapeError, match="expected finite numbers"):
        write_program(program, move_by(program, np.nan))


@pytest.mark.parametrize(
    ("statement", "reasons"),
    [
        ("pPath[1].trsf.x=5", [Reason.EXPRESSION] * 4),
        ("link(pPath[1],fCell)", [Reason.EXPRESSION] * 3 + [Reason.EXPRESSION]),
        ("setFrame(pSafe,pSafe,pSafe,fCell)", [Reason.UNKNOWN_FRAME] * 4),
        ("tMill.trsf.z=3", [Reason.UNKNOWN_FRAME] * 4),
        ("movel(pPath[0],flange,mNom)", [Reason.UNKNOWN_FRAME, NONE, NONE, NONE]),
        ("movel(pPath[nA[nB[1]]],tMill,mNom)", [Reason.EXPRESSION] * 4),
        ("movel(pPath[0],tMill[nTool],mNom)", [Reason.UNKNOWN_FRAME, NONE, NONE, NONE]),
        ("call setup()", [Reason.EXPRESSION] * 4),
        ('taskCreate "t",10,watch()', [Reason.EXPRESSION] * 4),
        ("movel(appro(pPath[0],{0,0,-50,0,0,0}),tMill,mNom)", [NONE] * 4),
        ("movel(compose(pPath[0],fCell,{0,0,9,0,0,0}),tMill,mNom)", [NONE] * 4),
        ("movel(compose(pPath[0],fCell,tr),tMill,mNom)", [Reason.EXPRESSION] * 4),
        ("pThere=here(tMill,fCell)", [NONE] * 4),
        ("nLast=size(pPath)-1", [NONE] * 4),
        ("trHere=position(pPath[0],fCell)", [Reason.EXPRESSION] * 4),
        ("setFrame(appro(pPath[0],tr),pSafe,pSafe,fOther)", [Reason.EXPRESSION] * 4),
        ("call cut(appro(pPath[0],tr))", [Reason.EXPRESSION] * 4),
        ("pThere.trsf=appro(pPath[0],tr).trsf", [Reason.EXPRESSION] * 4),
        ("pThere=appro(pPath[0],tr)\n  movel(pThere,tMill,mNom)", [NONE] * 4),
        ("pThere=appro(pPath[0],tr)\n  fOther.trsf=pThere.trsf", [Reason.EXPRESSION] * 4),
        ("pA=appro(pPath[0],tr)\n  pB=appro(pA,tr)\n  nX=pB.trsf.x", [Reason.EXPRESSION] * 4),
        ("pThere=pPath[nI]\n  movel(pThere,tMill,mNom)", [NONE] * 4),
        ("pThere=pPath[nI]\n  pThere.trsf.z=nZ", [Reason.EXPRESSION] * 4),
        ("movec(pOther,pPath[3],tMill,mNom)", [NONE] * 2 + [Reason.INCOMPLETE] * 2),
        ('taskCreateSync "t",0.004,bLate,watch()', [Reason.EXPRESSION] * 4),
        ('taskCreate "t"+toString("",n),10,watch(1,(2))', [Reason.EXPRESSION] * 4),
        ("if fCell.trsf.z>tMill.trsf.z", [NONE] * 4),
        ("fOther=fCell\n  trWorld=position(fCell,world)", [NONE] * 4),
        ("pThere=jointToPoint(tMill,fCell,jHome)", [NONE] * 4),
    ],
)
def test_what_a_statement_does_to_the_points(statement: str, reasons: list[Reason]) -> None:
    program = read_points(BODY.replace("waitEndMove()", statement))
    assert program.reason[:4].tolist() == reasons
    assert write_program(program, move_by(program, 0.0)) == DTX.encode()


def test_targets_computed_from_a_point_are_reported() -> None:
    program = read_points(BODY.replace("waitEndMove()", "movel(appro(pPath[0],tr),tMill,mNom)"))
    moves = "app.dtx:19, 20, 21, 22: this point is also copied, or in appro or compose: targets"
    assert any(note.startswith(moves) for note in program.notes)
    program = read_points(BODY.replace("waitEndMove()", "movel(appro(pSafe,tr),tMill,mNom)"))
    assert program.reason[4] == Reason.RELATIVE
    assert (
        "app.dtx:25: only copies, appro or compose use these points; not compensated."
        in program.notes
    )


def read_calls(body: str, head: str, code: str) -> Program:
    """The points of the sample, moved to by a routine; its head has its name and parameters."""
    name, *given = head.split()
    listed = [
        f'<Parameter name="{each.strip("&")}" use="{"reference" if "&" in each else "value"}" />'
        for each in given
    ]
    own = f"<Parameters>{''.join(listed)}</Parameters>\n"
    called = pgx(f"begin\n{code}\nend", name=name, own=own)
    files = (("app.dtx", DTX), ("cut.pgx", pgx(f"begin\n{body}\nend")), ("go.pgx", called))
    job = [(name, text.encode()) for name, text in files]
    return find_language("val3").read_job(job, frames=FrameTable())[0]


REACH = "movel(appro(x_p,tr),x_t,mNom); movel(x_p,x_t,mNom)"
MOVED = "movel(x_p,tMill,mNom)"
ARC = "movec(x_p,pPath[0],tMill,mNom)"


@pytest.mark.parametrize(
    ("head", "code", "call", "reasons"),
    [
        ("go x_p x_t", REACH, "call go(pPath[1],tMill)", [NONE] * 4),
        ("go x_p x_t", REACH, "for i=0 to 3; call go( pPath[i], tMill ); endFor", [NONE] * 4),
        ("go x_p x_t", REACH, "call go(pPath[1],flange)", [NONE, UNKNOWN, NONE, NONE]),
        ("go x_p x_t", REACH, "call go(pPath[1],tNone)", [NONE, UNKNOWN, NONE, NONE]),
        ("go x_p x_t", REACH, 'taskCreate "t",10,go(pPath[1],tMill)', [READ] * 4),
        ("go x_p x_t", REACH, "call go(pPath[1],tMill,1)", [READ] * 4),
        ("go x_p", "x_p.trsf.z=1; " + MOVED, "call go(pPath[1])", [READ] * 4),
        ("go &x_p", "x_p=here(tMill,fPart)", "call go(pPath[1])", [READ] * 4),
        ("go x_p", "l_p=x_p; z=l_p.trsf.z", "call go(pPath[1])", [READ] * 4),
        ("go x_p", "z=x_p.trsf.z", "call go(appro(pPath[1],tr))", [READ] * 4),
        ("go x_p", MOVED, "call go(appro(pPath[1],tr))", [NONE] * 4),
        ("go &x_p", "movel(x_p[1],tMill,mNom)", "call go(pPath[1])", [READ] * 4),
        ("go x_p &x_t", f"x_t.trsf.z=5; {MOVED}", "call go(pPath[1],tMill)", [UNKNOWN] * 4),
        ("go x_p", MOVED + "; call go(x_p)", "call go(pPath[1])", [NONE] * 4),
        ("go x_p x_q", MOVED + "; call go(x_q,x_p)", "call go(pPath[1],pPath[0])", [NONE] * 4),
        ("go x_p", ARC, "call go(pPath[1])", [NONE] * 4),
        ("go x_p", ARC, "call go(here(tMill,fPart))", [Reason.INCOMPLETE, NONE, NONE, NONE]),
    ],
)  # fmt: skip
def test_points_that_routines_are_given(
    head: str, code: str, call: str, reasons: list[Reason]
) -> None:
    first = "" if code == ARC else "movel(pPath[0],tMill,mNom)\n"
    moves = "".join(f"movel(pPath[{k}],tMill,mNom)\n" for k in (1, 2, 3))
    program = read_calls(first + moves + call.replace("; ", "\n"), head, code.replace("; ", "\n"))
    assert program.reason[:4].tolist() == reasons


def test_the_path_goes_through_points_that_a_routine_is_given() -> None:
    body = "movel(pPath[0],tMill,mNom)\ncall go(pPath[2],tMill)\nmovel(pPath[1],tMill,mNom)"
    program = read_calls(body, "go x_p x_t", REACH.replace("; ", "\n"))
    assert [row for row in program.path[:, 1].tolist() if row >= 0] == [0, 2, 1]
    assert program.motion[2] == Motion.LIN


def test_a_routine_that_only_calls_itself_moves_with_a_tool_that_is_not_known() -> None:
    itself = "movel(pPath[1],x_t,mNom)\ncall go(x_p,x_t)"
    program = read_calls("movel(pPath[1],tMill,mNom)", "go x_p x_t", itself)
    assert program.reason[1] == Reason.UNKNOWN_FRAME


def test_calls_that_lead_to_many_calls_are_not_followed() -> None:
    names = [f"x_{k}" for k in range(8)]
    swapped = [names[1], names[0], *names[2:]], [*names[1:], names[0]]
    calls = "\n".join(f"call go({','.join(each)})" for each in swapped)
    body = f"call go({','.join(f'pPath[{k % 4}]' for k in range(4))},pSafe,pA,pB,pC)"
    moves = "".join(f"movel(pPath[{k}],tMill,mNom)\n" for k in range(4))
    program = read_calls(moves + body, f"go {' '.join(names)}", f"movel(x_0,tMill,mNom)\n{calls}")
    assert program.reason[:4].tolist() == [READ] * 4


def test_a_parameter_by_reference_takes_a_shifted_point_out_of_sight() -> None:
    body = BODY.replace("waitEndMove()", "x_p=appro(pPath[0],tr)")
    own = '<Parameters><Parameter name="x_p" type="pointRx" {} /></Parameters>\n'
    assert read_points(body, own=own.format("")).reason[0] == NONE
    shared = read_points(body, own=own.format('use="reference"'))
    assert shared.reason[0] == Reason.EXPRESSION


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ("movel(lib:pSafe,tMill,mNom)", NONE),
        ("movel(lib:pPath[nI],tOther,mNom)", Reason.EXPRESSION),
        ("lib:pPath[1].trsf.x=5", Reason.EXPRESSION),
        ("lib:fCell.trsf.z=5", Reason.UNKNOWN_FRAME),
        ("lib:tMill=tOther", Reason.UNKNOWN_FRAME),
        ("movel(pOwn,lib:tMill,mNom)", NONE),
    ],
)
def test_data_of_a_library_that_another_application_names(statement: str, expected: Reason) -> None:
    own = DTX[: DTX.index("    <Data")] + (
        '<Data name="pOwn" type="pointRx"><Value x="1" y="2" z="3" rx="0" ry="0" rz="0" /></Data>'
        "</Datas></Database>"
    )
    files = [("own.dtx", own), ("own.pgx", pgx(f"begin\n  {statement}\nend", name="start"))]
    files += [("app.dtx", DTX), ("cut.pgx", pgx())]
    job = [(name, text.encode()) for name, text in files]
    programs = find_language("val3").read_job(job, frames=FrameTable())
    assert programs[2].reason[:2].tolist() == [expected] * 2


@pytest.mark.parametrize(
    ("statement", "expected"),
    [
        ("x=1", NONE),
        ("fCell.trsf={1,2,3,0,0,0}", Reason.UNKNOWN_FRAME),
        ("nErr=setFrame(pO,pX,pY,fPart[1])", Reason.UNKNOWN_FRAME),
        ("fPart[nI].trsf.z=5", Reason.UNKNOWN_FRAME),
        ("link(fCell,fOther)", Reason.UNKNOWN_FRAME),
        ("tMill.trsf.z=5", Reason.UNKNOWN_FRAME),
    ],
)
def test_frames_and_tools_that_another_program_of_the_application_changes(
    statement: str, expected: Reason
) -> None:
    other = pgx(f"begin\n  {statement}\nend", name="setup")
    files = [("app.dtx", DTX.encode()), ("setup.pgx", other.encode()), ("cut.pgx", pgx().encode())]
    for each in (files, files[::-1]):
        job = find_language("val3").read_job(each, frames=FrameTable())
        points = next(program for program in job if len(program))
        assert points.reason[:2].tolist() == [expected] * 2


def test_arcs_are_compensated_together_or_not_at_all() -> None:
    program = read_points(BODY.replace("waitEndMove()", "movel(pPath[2],flange,mNom)"))
    assert program.reason[:4].tolist() == [NONE, NONE] + [Reason.UNKNOWN_FRAME] * 2


def test_a_computed_subscript_moves_to_all_elements() -> None:
    loop = "begin\n for nI=0 to 3\n  movel(pPath[nI],tMill,mNom)\n endFor\nend"
    program = read_points(loop)
    assert program.reason[:4].tolist() == [NONE] * 4
    assert program.motion[:4].tolist() == [Motion.LIN] * 4
    other = loop.replace("endFor", "movel(pPath[nI+1],tOther,mNom)\n endFor")
    assert read_points(other).reason[:4].tolist() == [Reason.UNKNOWN_FRAME] * 4


def test_parameters_hide_data_of_the_same_name() -> None:
    own = '    <Parameters><Parameter name="pPath" type="pointRx" /></Parameters>\n'
    program = read_points(own=own)
    assert program.reason[:4].tolist() == [Reason.UNUSED] * 4


def test_frames_and_routines_that_the_cell_states() -> None:
    frames = FrameTable(
        bases={"world": pose(np.eye(3), np.array([0, 0, 0.4])), "fCell": np.eye(4)},
        tools={"lib:tCut": np.eye(4)}, harmless_routines=("lib:start",),
    )  # fmt: skip
    body = BODY.replace("tMill,", "lib:tCut,").replace("waitEndMove()", "call lib:start()")
    program = read_points(body, frames=frames)
    assert program.reason[:4].tolist() == [NONE] * 4
    assert program.T_base_frame[program.frame[2]] == pytest.approx(np.eye(4))
    assert program.T_base_frame[program.frame[3]][2, 3] == pytest.approx(0.4)
    lost = read_points(body.replace("call lib:start()", ""))
    assert lost.reason[:4].tolist() == [Reason.UNKNOWN_FRAME] * 4
    assert any("lib:tCut is in no file given" in note for note in lost.notes)


def test_a_point_that_leaves_numbers_out_is_left_alone() -> None:
    program = read_points(BODY.replace("waitEndMove()", "movel(pSafe,tMill,mNom)"))
    assert program.reason[4] == Reason.INCOMPLETE
    assert any("app.dtx:25: numbers of points are left out" in note for note in program.notes)


def test_a_project_and_a_folder_are_one_job(tmp_path: Path) -> None:
    for name, text in (("app.pjx", PJX), ("cut.pgx", pgx()), ("app.dtx", DTX)):
        (tmp_path / name).write_text(text)
    job = read_job(tmp_path / "app.pjx")
    assert [(program.name, len(program)) for program in job] == [("app.pjx", 0), ("app.dtx", 6)]
    assert (job[1].reason[:4] == NONE).all()
    assert sum(len(program) for program in read_job(tmp_path)) == 6
    (tmp_path / "cut.dtx").write_text(DTX)
    assert [program.name for program in read_job(tmp_path / "cut.pgx")] == ["cut.pgx", "cut.dtx"]


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (DTX[:900], r"app\.dtx:\d+: not well-formed XML"),
        (DTX.replace('x="100.000"', 'x="1O0"'), r"app\.dtx:19: x of pPath\[0\] is '1O0'"),
        (DTX.replace('key="1" x="110', 'key="0" x="110'), r"app\.dtx:20: pPath\[0\] occurs twice"),
        (DTX.replace("<Database", "<!DOCTYPE a><Database"), "a document type declaration"),
        (PJX.replace('"true"', '"false"'), "counts in inches"),
        ("<programList xmlns='ProgramNameSpace'></programList>", "before version 7"),
        ("<a/>", "<a> is no VAL3 file"),
    ],
)
def test_what_is_refused(data: str, why: str) -> None:
    with pytest.raises(FormatError, match=why):
        find_language("val3").read(data.encode(), name="app.dtx", frames=FrameTable())


def test_frames_and_tools_are_printed_and_read_back() -> None:
    T = pose(turn(12.5, -33.25, 170.0), np.array([0.8, -0.0123456, 0.25]))
    frame, tool = controller_frame(T, "val3", name="fMine"), controller_tool(T, "val3", name="tMy")
    dtx = DTX.replace("  <Datas>\n", "  <Datas>\n" + frame.text + tool.text)
    dtx = dtx.replace('fatherId="fPart[0]"', 'fatherId="fMine[0]"')
    program = read_points(BODY.replace("tMill,", "tMy,"), dtx=dtx)
    assert program.T_base_frame[program.frame[2]] == pytest.approx(T, abs=1e-7)
    assert program.T_flange_tool[program.tool[2]] == pytest.approx(T, abs=1e-7)


def test_content_names_the_language() -> None:
    for data in (DTX, PJX, pgx(), "<programList xmlns='ProgramNameSpace'/>"):
        assert detect(data.encode(), "noname").name == "val3"
