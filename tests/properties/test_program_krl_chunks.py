"""KRL programs of any lines: in blocks they are the whole, target for target and byte for byte."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

from robotrue.core.arm_words import NO_WORD
from robotrue.program.formats import file_survey, read_job, write_program
from robotrue.program.program import FrameTable, Program, Reason, Replacement
from robotrue.program.program_chunk import Whole
from robotrue.program.program_file import outline_job, read_chunk

NUMBER = st.integers(-900_000, 900_000).map(lambda k: f"{k / 1000:.3f}")
POSE = st.lists(NUMBER, min_size=6, max_size=6).map(
    lambda v: ",".join(f"{name} {x}" for name, x in zip("XYZABC", v, strict=True))
)
FULL = st.tuples(st.sampled_from(["LIN", "lin ", "PTP", "SLIN", "SPL"]), POSE).map(
    lambda t: f"{t[0]} {{{t[1]}}}"
)
PLAIN = st.one_of(
    FULL,
    FULL,
    FULL.map(lambda line: f"{line} C_DIS ; {{X 1"),
    POSE.map(lambda p: f"PTP {{{p},S 2,T 35}} C_PTP"),
    st.tuples(POSE, POSE).map(lambda t: f"CIRC {{{t[0]}}},{{{t[1]}}}, CA 90"),
    POSE.map(lambda p: f"SLIN {{{p}}} WITH $VEL.CP=0.3,$ACC.CP=.5"),
    st.sampled_from(["", "; LIN {X 1}", "$VEL.CP=0.1", "WAIT SEC 0.5", ";FOLD {", "$OUT[3]=TRUE"]),
)
PARTIAL = st.sampled_from(
    ["LIN {X 1.5}", "LIN {Y 2.000,Z 3} C_DIS", "PTP {A 1,B 2,C 3}", "LIN {X xx}"]
)
AXES = st.sampled_from(["PTP {A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}", "PTP {A1 5}"])
STATEMENT = st.sampled_from(
    [
        "$BASE={X 1,Y 2,Z 3,A 4,B 5,C 6}", "$BASE=BASE_DATA[3]", "$BASE=$NULLFRAME",
        "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}", "BAS(#BASE,1)", "BAS(#TOOL,2)", "i=i+1", "x.X=5",
        "CALLED(1)", "WAIT FOR a",
        "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}", "BAS(#FRAMES)", "here:",
        "GOTO here", "$IPO_MODE=#TCP", "$IPO_MODE=#BASE", "HALT", "RETURN",
    ]
)  # fmt: skip
BLOCKS = [
    (["IF a THEN"], ["ENDIF"]), (["FOR i=1 TO 3"], ["ENDFOR"]), (["LOOP"], ["EXIT", "ENDLOOP"]),
    (["SWITCH k", "CASE 1"], ["CASE 2", "ENDSWITCH"]), (["SPLINE"], ["ENDSPLINE"]),
]  # fmt: skip


@st.composite
def programs(draw: st.DrawFn) -> bytes:
    body: list[str] = []
    for _ in range(draw(st.integers(1, 6))):
        some = draw(st.lists(PLAIN, min_size=0, max_size=25))
        kind = draw(st.integers(0, 12))
        if kind == 0 and some:
            some.insert(draw(st.integers(0, len(some))), draw(PARTIAL))
        elif kind == 1:
            some.insert(draw(st.integers(0, len(some))), draw(AXES))
        elif kind == 2:
            head, tail = draw(st.sampled_from(BLOCKS))
            some = [*head, *some, *tail]
        body += [*some, draw(STATEMENT)] if draw(st.booleans()) else some
    end = draw(st.sampled_from(["\n", "\r\n"]))
    return end.join(["&ACCESS RVP", "DEF part()", *body, "END", ""]).encode()


def rewritten(program: Program) -> bytes:
    """Every compensable target moved, by what depends on its own numbers alone."""
    with np.errstate(invalid="ignore"):
        shift = np.sin(1e3 * program.position) * 2e-4
    change = Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + shift,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )
    return write_program(program, change)


def require_same(path: Path, targets: int) -> None:
    frames = FrameTable(bases={"1": np.diag([1.0, -1.0, -1.0, 1.0])})
    found = outline_job(path, frames, targets=targets)
    (whole,) = read_job(path, frames)
    if isinstance(found, Whole):
        event(f"whole: {found.why.split('targets after')[-1]}")
        return
    (found,) = found
    event(f"{min(len(found.chunks), 5)} blocks or more")
    parts = [
        read_chunk(whole.data[c.lines.start : c.lines.end], c.lines, found.content).program
        for c in found.chunks
    ]
    assert [len(p) for p in parts] == [b.targets for b in found.chunks]
    for name in ("position", "rotation", "axes", "motion", "reason", "words", "line"):
        joined = np.concatenate([getattr(p, name) for p in parts])
        np.testing.assert_array_equal(joined, getattr(whole, name), err_msg=name)
    known = np.isin(whole.reason, [Reason.NONE, Reason.JOINT_TARGET])
    for index, table in (("frame", "T_base_frame"), ("tool", "T_flange_tool")):
        joined = np.concatenate([getattr(p, table)[getattr(p, index)] for p in parts])
        expected = getattr(whole, table)[getattr(whole, index)]
        np.testing.assert_array_equal(joined[known], expected[known], err_msg=index)
    assert b"".join(rewritten(part) for part in parts) == rewritten(whole)


@settings(
    max_examples=40, deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)  # fmt: skip
@given(programs(), st.integers(1, 30), st.integers(40, 4000))
def test_blocks_are_the_whole(data: bytes, targets: int, window: int) -> None:
    before = file_survey.WINDOW
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "part.src"
        path.write_bytes(data)
        try:
            file_survey.WINDOW = window
            require_same(path, targets)
        finally:
            file_survey.WINDOW = before
