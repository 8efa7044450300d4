"""Damaged KRL files are refused with their line, or read and written back byte for byte."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.arm_words import NO_WORD
from robotrue.errors import FormatError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Reason, Replacement

KRL = find_language("krl")
SAMPLE = b"""&ACCESS RVP
DEF part( )
INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO h( )
FDAT_ACT={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}
BAS(#CP_PARAMS,0.2)
$BASE={FRAME: X 1,Y 2,Z 3,A 4,B 5,C 6}
gs[1]={fCnC {X 1.0,Y 2.0,Z 3,A 4,B 5,C 6}, grF 3}
FOR i=1 TO 3
LIN gs[i].fCnC C_DIS
ENDFOR
IF $IN[2] THEN
GOTO lab
ELSE
SUB(1)
ENDIF
lab:
SPLINE WITH $BASE={X 1,Y 2,Z 3,A 4,B 5,C 6}
SPL {X 1.0,Y 2.0,Z 3,A 4,B 5,C 6,S'B010',T'H1F',E1 0.0} WITH $TOOL=$NULLFRAME
SCIRC {X 1.0},{X 1.0,Y 2.0,Z 3,A 4,B 5,C 6}, CA 90
ENDSPLINE
SWITCH n
CASE 1
LIN {X 5} ; left out {
DEFAULT
PTP {AXIS: A1 5,A2 -90,A3 90,A4 0,A5 0,A6 -1.5E-03}
ENDSWITCH
REPEAT
p.X=p.X+1
LIN p:{Z 5}
UNTIL TRUE
END
DEF SUB(n:IN)
RETURN
LIN_REL {Z 5}
END
DEF h( )
BAS(#TOOL,0)
RESUME
END
"""
PIECES = [
    *(b"{", b"}", b"[", b"]", b"(", b")", b",", b";", b"'", b'"', b":", b"=", b"\n", b"\r", b"."),
    *(b"$BASE", b"LIN ", b"X", b"1E9", b"\xff", b"CIRC ", b"END\n", b"DEF sub()\n", b"\x00"),
    *(b"GOTO lab\n", b"LOOP\n", b"ENDLOOP\n", b"IF\n", b"ENDIF\n", b"sub()\n", b"h()\n", b"EXIT\n"),
    *(b"9" * 20, b"'HFFFFFFFFFFFF'", b"S 1E300", b" WITH $BASE=", b"fdat_act.x=", b"bas(#frames)"),
]


def check(data: bytes, name: str = "part.src") -> bool:
    """Returns whether the file was read; then its zero correction is the file itself."""
    try:
        program = KRL.read(data, name=name, frames=FrameTable())
    except FormatError as error:
        refused = error
    else:
        refused = None
    if refused is not None:
        assert refused.source == name
        assert refused.line is not None
        assert 1 <= refused.line <= data.count(b"\n") + data.count(b"\r") + 1
        return False
    change = Replacement(
        changed=np.isin(program.reason, (Reason.NONE, Reason.JOINT_TARGET)),
        position=program.position,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )
    assert KRL.write(program, change) == data
    return True


def test_cut_off_at_every_byte() -> None:
    read = sum(check(SAMPLE[:size]) for size in range(len(SAMPLE) + 1))
    assert 0 < read < len(SAMPLE)


edits = st.lists(
    st.tuples(
        st.floats(0, 1, exclude_max=True),
        st.integers(0, 8),
        st.one_of(st.sampled_from(PIECES), st.binary(max_size=3), st.just(b"")),
    ),
    min_size=1,
    max_size=6,
)


@given(edits, st.sampled_from(["part.src", "part.dat"]))
@settings(max_examples=300, deadline=None)
def test_edited_anywhere(changes: list[tuple[float, int, bytes]], name: str) -> None:
    data = SAMPLE
    for where, cut, piece in changes:
        at = int(where * (len(data) + 1))
        data = data[:at] + piece + data[at + cut :]
    check(data, name)


@given(st.binary(max_size=400), st.sampled_from(["part.src", "part.dat"]))
@settings(max_examples=150, deadline=None)
def test_any_bytes(data: bytes, name: str) -> None:
    check(data, name)


def test_deep_nesting_ends() -> None:
    """Every loop may change what the ones around it start with; the iteration still ends."""
    depth = 300
    inner = "LIN {X 1.0,Y 2.0,Z 3,A 4,B 5,C 6}\n"
    opens = "".join(f"LOOP\nBAS(#BASE,{i})\nsub()\na{i}:\n" for i in range(depth))
    closes = "".join(f"GOTO a{depth - 1 - i}\nENDLOOP\n" for i in range(depth))
    text = f"DEF p()\n{opens}{inner}{closes}END\nDEF sub()\nIF x\nsub()\nBAS(#TOOL,1)\nENDIF\nEND\n"
    assert check(text.encode())
