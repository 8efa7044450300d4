"""Laws of the UR script dialect on scripts nobody wrote by hand, and on damaged ones."""

from __future__ import annotations

import re

import numpy as np
from damaged import Edits, edited, edits, read_or_refused
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason, Replacement

UR = find_language("urscript")


@st.composite
def poses(draw: st.DrawFn) -> str:
    """A literal; its numbers come of one drawn seed, which keeps the drawing cheap."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    place = rng.uniform(-2, 2, 3)
    turn = rng.normal(size=3)
    turn *= rng.choice([0.1, 1.0, 3.0, np.pi - 1e-5, np.pi, 4.0]) / np.linalg.norm(turn)
    numbers = [f"{value:.{rng.integers(6, 10)}f}" for value in (*place, *turn)]
    return "p[" + draw(st.sampled_from([",", ", ", " , "])).join(numbers) + "]"


@st.composite
def scripts(draw: st.DrawFn) -> bytes:
    lines = ["def part():"]
    for i in range(draw(st.integers(1, 7))):
        a, b = draw(poses()), draw(poses())
        lines += draw(
            st.sampled_from(
                [
                    [f"  movel({a},1.2,0.25,0,0.001)"],
                    [f"movej( {a}, a=1) # to {b}"],
                    [f"movec({a},", f"  {b},1,0.1,0)"],
                    [f"movep(pose={a})", f'textmsg("movel({b}")'],
                    [f"global p{i}={a}", f"movel(p{i})"],
                    [f"f{i} = {a}", f"movel(pose_trans(f{i}, {b}))"],
                    [f"set_tcp({a})", "if x > 1:", f"movel({b})", "else:", "sleep(1)", "end"],
                    [f"movej(get_inverse_kin({a}),1)", f"p{i}=pose_add({a},{b})"],
                    ["movej([0.1,-1.5,1.5,0.0,1.5,-0.25],1,1,0,0)", "# \xe4\xf6 ("],
                ]
            )
        )
    end = draw(st.sampled_from(["\n", "\r\n"]))
    text = end.join([*lines, "end", "part()"]) + draw(st.sampled_from(["", end]))
    return draw(st.sampled_from([b"", b"\xef\xbb\xbf"])) + text.encode("latin-1")


def read(data: bytes) -> Program:
    return UR.read(data, name="part.script", frames=FrameTable())


def moved(program: Program, shift: np.ndarray, turn: np.ndarray) -> Replacement:
    return Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position + shift,
        rotation=program.rotation @ turn,
        axes=program.axes,
        words=program.words,
    )


STILL = (np.zeros(3), np.eye(3))


@given(scripts())
@settings(max_examples=40, deadline=None)
def test_zero_correction_is_the_identity(data: bytes) -> None:
    program = read(data)
    assert UR.write(program, moved(program, *STILL)) == data


@given(scripts(), st.integers(0, 2**32 - 1))
@settings(max_examples=40, deadline=None)
def test_what_is_written_is_read_again_and_nothing_else_changed(data: bytes, seed: int) -> None:
    program = read(data)
    rng = np.random.default_rng(seed)
    shift = rng.normal(0.0, 1.0, (len(program), 3)) * MM
    turn = matrix_from_rotation_vector(rng.normal(0.0, 0.1, (len(program), 3)) * DEG)
    change = moved(program, shift, turn)
    out = UR.write(program, change)
    again = read(out)
    use = change.changed & (program.reason == Reason.NONE)
    np.testing.assert_array_equal(again.reason, program.reason)
    # Six decimals at least: half a micrometre, and half a microradian in each component.
    assert np.abs(again.position - change.position)[use].max(initial=0) <= 0.5001e-6
    assert np.abs(again.rotation - change.rotation)[use].max(initial=0) <= 3 * 0.5001e-6
    # The vector stays the one that is near, also about half a turn.
    step = again.spans.numbers.value - program.spans.numbers.value
    assert np.abs(step)[use].max(initial=0) <= 0.05
    numbers = re.compile(rb"[+-]?\d+\.\d+")
    assert numbers.sub(b"#", out) == numbers.sub(b"#", data)
    back = read(UR.write(again, moved(again, program.position - again.position, np.eye(3))))
    assert np.abs(back.position - program.position)[use].max(initial=0) <= 0.5001e-6


SAMPLE = b"""def part():
  global v = 0.3 # speed
  def go(a, b=1):
    if a == 0:
      movel(p[a,0,0,0,0,0])
    elif b:
      set_tcp(p[0,0,0.2155,0,0.5,0])
    else:
      return 1
    end
  end
  thread watch():
    while True:
      set_tcp(tool)
      break
    end
  end
  f = p[1,2,3,0,0,0]
  q1 = [0.1,-1.5,1.5,0.0,1.5,-0.25]
  textmsg("a # (", f)
  set_tcp(p[0,0,0.2155,0,0.5,0])
  movej(q1,a=1)
  movep(p[1,2,3,0,0,0])
  while v > 0:
    movel(pose_trans(p[1,2,3,0,0,0], p[.1,-0.2,
      3.0,0,0,3.1]), a=1, v=v)
    go(1)
  end
  movec(p[1,2,3,0,0,0],p[1,2,3,0,0,1E-3],1,0.1,0)
  movel(pose_add(f,p[0,0,0.1,0,0,0]))
end
part()
"""
PIECES = [
    *(b"[", b"]", b"(", b")", b",", b"=", b"#", b'"', b":", b"\n", b"\r", b".", b"p[", b"end\n"),
    *(b"def x():\n", b"if x:\n", b"else:\n", b"while x:\n", b"movel(", b"movec(", b"set_tcp("),
    *(b"pose_trans(", b"get_inverse_kin(", b"f", b"q1", b"1E999", b"\xff", b"\x00", b"local "),
]


def check(data: bytes) -> bool:
    """Returns whether the file was read; then its zero correction is the file itself."""
    return read_or_refused(read, UR, moved, "part.script", data)


def test_cut_off_at_every_byte() -> None:
    assert sum(check(SAMPLE[:size]) for size in range(len(SAMPLE) + 1)) < 12
    assert read(SAMPLE).reason.tolist() == [1, 8, 5, 0, 3, 3, 3, 2]


@given(edits(PIECES))
@settings(max_examples=150, deadline=None)
def test_edited_anywhere(changes: Edits) -> None:
    check(edited(SAMPLE, changes))


@given(st.one_of(st.binary(max_size=300), st.text('movelcjp[](),:=#" \n019.').map(str.encode)))
@settings(max_examples=100, deadline=None)
def test_any_bytes(data: bytes) -> None:
    check(data)
    check(b"def a():\n" + data + b"\nend\n")
