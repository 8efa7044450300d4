"""APT and CL data: what is read, and every line that is refused."""

from __future__ import annotations

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.apt import read_apt
from robotrue.program.toolpath import Toolpath, cut_length, duration, summary

HEAD = """\
$$ -----------------------------------------------------------------
$$*CATIA0
$$ Machining Axis System.1
$$   1.00000   0.00000   0.00000   0.00000
$$   0.00000   1.00000   0.00000   0.00000
$$   0.00000   0.00000   1.00000   0.00000
PARTNO BLOCK, 12 $$ not a comment of the part
UNITS/MM
LOADTL/3
SPINDL/ 12000.0000,RPM,CLW
COOLNT/ON
MULTAX/ON
FROM  /   0.0,  0.0, 500.0
"""


def read(text: str, name: str = "side.apt") -> Toolpath:
    return read_apt(text.encode(), source=name)


def test_points_axes_feeds_and_rapids():
    path = read(
        HEAD + "$$ OPERATION NAME : Sweeping.1\n"
        "RAPID\n"
        "GOTO  /   10.00000,  20.00000,$\n"
        "   30.00000, 0.000000, 0.000000, 1.000000\n"
        "FEDRAT/ 300.0000,MMPM\n"
        "GOTO/10,20,.5\n"
        "TOOL PATH/Contour 2,TOOL,T3\n"
        "FEDRAT/MMPM,600.0\n"
        "GOTO/1.0E+01,21,-1.5D0,0.6,0,.8\n"
        "GODLTA/1,0,0\n"
        "FINI\n"
    )
    np.testing.assert_allclose(
        path.position, np.array([[10, 20, 30], [10, 20, 0.5], [10, 21, -1.5], [11, 21, -1.5]]) * MM
    )
    np.testing.assert_allclose(path.axis[[1, 3]], [[0, 0, 1], [0.6, 0, 0.8]], atol=1e-12)
    assert path.rapid.tolist() == [True, False, False, False]
    np.testing.assert_allclose(path.feed[1:], [5e-3, 1e-2, 1e-2])
    assert np.isnan(path.feed[0])
    assert path.line.tolist() == [16, 19, 22, 23]
    assert path.operations == ("Sweeping.1", "Contour 2")
    assert path.operation.tolist() == [0, 0, 1, 1]
    assert path.tools == (("3", 9),)
    assert path.notes == ()
    assert [r.text for r in path.remarks][:3] == [
        "PARTNO BLOCK, 12",
        "LOADTL/3",
        "SPINDL/ 12000.0000,RPM,CLW",
    ]
    assert "4 points" in summary(path)
    # 29.5 mm down, then (0, 1, -2), then 1 mm along x
    assert cut_length(path) == pytest.approx((29.5 + np.sqrt(5.0) + 1.0) * MM)
    want = 29.5 / 5.0 + np.sqrt(5.0) / 10.0 + 0.1
    assert duration(path, rapid=0.2) == pytest.approx(want)


def test_words_that_are_not_known_are_kept_and_listed_once():
    path = read("UNITS/MM\nWOBBLE/ON,3\nGOTO/0,0,0\nWOBBLE/OFF\nTLCOMP/XY\nCYCLE/OFF\nGOTO/1,0,0\n")
    unknown = [(r.before, r.line, r.text) for r in path.remarks if not r.known]
    assert unknown == [(0, 2, "WOBBLE/ON,3"), (1, 4, "WOBBLE/OFF"), (1, 5, "TLCOMP/XY")]
    assert path.notes == (
        "side.apt:2: WOBBLE is unknown; it was saved as a comment.",
        "side.apt:5: TLCOMP is unknown; it was saved as a comment.",
    )


def test_inches_per_minute_and_per_revolution():
    path = read(
        "UNITS/INCHES\nSPINDL/RPM,1200,CLW\nFEDRAT/10,IPM\nGOTO/1,0,0\nFEDRAT/0.01,IPR\nGOTO/2,0,0\n"
        "FEDRAT/30\nGOTO/3,0,0\nFEDRAT/.02,PERREV\nGOTO/4,0,0\n"
    )
    np.testing.assert_allclose(path.position[:, 0], np.arange(1, 5) * 25.4 * MM)
    np.testing.assert_allclose(path.feed / (25.4 * MM), [10 / 60, 0.2, 0.5, 0.4])


def test_without_units_millimetres_are_taken_and_said():
    path = read("GOTO/1,0,0\n")
    assert path.position[0, 0] == 1e-3
    assert path.notes == ("side.apt:1: the file does not state UNITS/: millimetres are assumed.",)


def test_a_byte_order_mark_windows_lines_and_an_umlaut_do_no_harm():
    data = "﻿PARTNO A\r\nUNITS/MM\r\nGOTO/1,2,3\r\n$$ Fräsen\r\n".encode("latin-1", "replace")
    assert len(read_apt(b"\xef\xbb\xbfUNITS/MM\r\nGOTO/1,2,3\r\n", source="a")) == 1
    assert len(read_apt(data.lstrip(b"?"), source="a")) == 1


@pytest.mark.parametrize(("axis", "top"), [("0,0,1", 1.0), ("0,0,-1", -1.0)])
def test_a_circle_turns_by_the_right_hand_rule(axis, top):
    path = read(
        f"UNITS/MM\nINTOL/0.001\nOUTTOL/0.003\nGOTO/10,0,5\nCIRCLE/0,0,5,{axis},10\nGOTO/-10,0,5\n"
    )
    arc = path.position[1:] / MM
    np.testing.assert_allclose(np.hypot(arc[:, 0], arc[:, 1]), 10.0, atol=1e-9)
    assert (top * arc[:-1, 1] > 0.0).all()
    assert path.line[1:].tolist() == [6] * len(arc)
    chord = 0.5 * np.linalg.norm(np.diff(path.position / MM, axis=0), axis=1)
    sagitta = 10.0 - np.sqrt(100.0 - chord**2)
    assert sagitta.max() <= 0.004 + 1e-12
    assert sagitta.max() > 0.003  # no finer than printed


def test_a_helix_a_whole_turn_and_several_points_of_one_arc():
    helix = read("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/10,0,-2\n").position / MM
    np.testing.assert_allclose(np.hypot(helix[:, 0], helix[:, 1]), 10.0, atol=1e-9)
    turn = np.unwrap(np.arctan2(helix[:, 1], helix[:, 0]))
    np.testing.assert_allclose(helix[:, 2], -turn / np.pi, atol=1e-9)
    assert turn[-1] == pytest.approx(2.0 * np.pi)
    two = read("UNITS/MM\nGOTO/10,0,0\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0,$\n-10,0,0\n").position
    assert two[:, 1].min() > -1e-12
    np.testing.assert_allclose(two[-1] / MM, [-10, 0, 0])


def test_the_arc_of_indirv_and_tlon_leaves_the_way_it_says():
    text = (
        "UNITS/MM\nGOTO/15,0,0\nINDIRV/ 0.0,{},0.0\n"
        "TLON,GOFWD/ (CIRCLE/ 0.0, 0.0, 0.0,$\n15.0),ON,(LINE/ 0.0,0.0,0.0, 0.0,15.0,0.0)\n"
    )
    short = read(text.format(1.0)).position
    long = read(text.format(-1.0)).position
    assert short.min() > -1e-12
    assert long[:, 1].min() == pytest.approx(-0.015, abs=1e-5)
    np.testing.assert_allclose(short[-1], [0, 0.015, 0], atol=1e-12)
    np.testing.assert_allclose(long[-1], short[-1])


def test_the_tool_axis_turns_along_an_arc():
    path = read("UNITS/MM\nGOTO/10,0,0,0,0,1\nCIRCLE/0,0,0,0,0,1,10\nGOTO/0,10,0,0.6,0,0.8\n")
    np.testing.assert_allclose(np.linalg.norm(path.axis, axis=1), 1.0)
    tilt = np.degrees(np.arccos(path.axis[:, 2]))
    assert (np.diff(tilt) > 0.0).all()
    assert tilt[-1] == pytest.approx(np.degrees(np.arctan2(0.6, 0.8)))


CREO = """\
$$*         Pro/CLfile
$$-> MFGNO / MFG0001
PARTNO / MFG0001
MACHIN / UNCX01, 1
UNITS / MM
LOADTL / 1
$$-> CUTTER / 20.000000
$$-> CSYS / 1.0000000000, 0.0000000000, 0.0000000000, 0.0000000000, $
            0.0000000000, 1.0000000000, 0.0000000000, 0.0000000000, $
            0.0000000000, 0.0000000000, 1.0000000000, 0.0000000000
SPINDL / RPM, 1000.000000,  CLW
RAPID
GOTO / 12.0000000000, 0.0000000000, 50.0000000000
FEDRAT / 100.000000,  MMPM
GOTO / 12.0000000000, 0.0000000000, 0.0000000000
CIRCLE / 0.0000000000, 0.0000000000, 0.0000000000,$
0.0000000000, 0.0000000000, 1.0000000000, 12.0000000000
GOTO / 0.0000000000, 12.0000000000, 0.0000000000
SPINDL / OFF
$$-> END /
FINI
"""
NX = """\
TOOL PATH/CAVITY_MILL,TOOL,MILL
TLDATA/MILL,10.0000,0.0000,75.0000,0.0000,0.0000
MSYS/0.0000,0.0000,0.0000,1.0000000,0.0000000,0.0000000,0.0000000,1.0000000,0.0000000
$$ centerline data
PAINT/PATH
LOADTL/1
SPINDL/RPM,1200,CLW
RAPID
GOTO/0.0000,0.0000,50.0000,0.0000000,0.0000000,1.0000000
PAINT/COLOR,211
FEDRAT/MMPM,250.0000
GOTO/0.0000,0.0000,10.0000
GOTO/5.0000,0.0000,10.0000
PAINT/TOOL,NOMORE
END-OF-PATH
"""


def test_files_as_the_big_systems_write_them():
    creo = read(CREO)
    assert creo.notes == ()
    assert creo.rapid.tolist()[:2] == [True, False]
    np.testing.assert_allclose(creo.position[-1] / MM, [0, 12, 0], atol=1e-12)
    nx = read(NX)
    assert nx.notes == ("side.apt:1: the file does not state UNITS/: millimetres are assumed.",)
    assert nx.operations == ("CAVITY_MILL",)
    assert len(nx) == 3
    assert all(remark.known for remark in (*nx.remarks, *creo.remarks))
    shifted = CREO.replace("0.0000000000, $", "5.0000000000, $", 1)
    assert "in a machining axis system" in read(shifted).notes[0]


def test_a_dollar_in_a_comment_swallows_no_point():
    path = read("UNITS/MM\n$$ costs 5 $\nGOTO/1,2,3\n$$-> NOTE $\nGOTO/4,5,6\n")
    assert len(path) == 2


REFUSED = {
    "10.0,20.0,30.0": "no statement",
    "GOTO/A,B,C": "'A', expected a number",
    "GOTO/1,2": "2 numbers, expected 3 or 6",
    "GOTO/1,2,3,4,5": "5 numbers",
    "GOTO/1,2,3,0,0,2": "length 2",
    "GOTO/1,2,nan": "expected a number",
    "GOTO/PT1": "expected a number",
    "UNITS/FURLONGS": "FURLONGS",
    "UNITS/INCHES": "after the first point",
    "FEDRAT/RAPID": "one number above 0",
    "FEDRAT/-3,MMPM": "one number above 0",
    "FEDRAT/3,INVERS": "expected MMPM",
    "MULTAX/MAYBE": "expected ON or OFF",
    "TLAXIS/0,0,0": "not a direction",
    "TRANS/1,0,0,0,0,1,0,0,0,0,1,0": "moves the coordinates",
    "ROTABL/90": "turns the part",
    "MODE/INCR": "only absolute ones are read",
    "CUTCOM/LEFT": "moves the path sideways",
    "CYCLE/DRILL,5": "makes its own motions",
    "GOLFT/L1,PAST,L2": "along surfaces",
    "CIRCLE/0,0,0,0,0,1,5,.002,.5,10,0": "11 numbers, expected 7",
    "CIRCLE/0,0,0,0,0,3,5": "axis of length 3",
    "TLON,GOFWD/ (CIRCLE/ 0,0,0,5),ON,(LINE/ 0,0,0,0,5,0)": "without INDIRV/",
    "TLON,GOFWD/ C1": "is not the arc",
    "INTOL/": "without a tolerance",
    "MOVARC/0,0,0,0,0,1,5,ANGLE,90": "differs between systems",
}


@pytest.mark.parametrize("statement", REFUSED, ids=lambda s: s.partition("/")[0] + s[-6:])
def test_what_cannot_be_understood_is_named_with_its_line(statement):
    with pytest.raises(FormatError, match=r"^job\.apt:4: ") as refused:
        read(f"UNITS/MM\nGOTO/5,0,0\n$$ here:\n{statement}\nGOTO/0,5,0\n", "job.apt")
    assert REFUSED[statement] in str(refused.value)
    assert refused.value.line == 4


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("UNITS/MM\nGOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,6,0\n", 3, "ends 1.000 mm off"),
        ("UNITS/MM\nGOTO/6,0,0\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,5,0\n", 3, "starts 1.000 mm off"),
        ("UNITS/MM\nCIRCLE/0,0,0,0,0,1,5\nGOTO/0,5,0\n", 3, "an arc before any point"),
        ("UNITS/MM\nGOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,5\n", 3, "without a GOTO/"),
        ("UNITS/MM\nGOTO/5,0,0\nCIRCLE/0,0,0,0,0,1,5\nRAPID\n", 4, "between a CIRCLE/ and"),
        ("UNITS/MM\nGODLTA/5,0,0\n", 2, "it has no start point"),
        ("UNITS/MM\nGOTO/1,2,$\n3,$\n", 2, "continued statement"),
        ("UNITS/MM\nMULTAX/OFF\nGOTO/1,2,3,0,1,0\n", 3, "after MULTAX/OFF"),
        ("UNITS/MM\nFEDRAT/.1,MMPR\nGOTO/1,2,3\n", 3, "per revolution"),
        ("UNITS/MM\nFEDRAT/900000,MMPM\nGOTO/1,2,3\n", 3, "at most 3000 mm/s"),
        ("MSYS/0,0,0,1,0,0,0,1,0\nGOTO/1,2,3\nMSYS/9,0,0,1,0,0,0,1,0\n", 3, "second machining"),
        ("GOTO/1,2,3\nMSYS/9,0,0,1,0,0,0,1,0\n", 2, "second machining"),
        ("UNITS/MM\nGOTO/1,2,3\0\n", 2, "NUL byte"),
        ("UNITS/MM\nGOTO/1,2,3E99\n", 2, "beyond 1e+07"),
        ("$$*CATIA0\n$$ A\n$$ 1 0 0 x\nGOTO/1,2,3\n", 3, "no row of the machining axis system"),
    ],
)
def test_what_does_not_go_together_is_named_with_its_line(text, line, says):
    with pytest.raises(FormatError, match=r"^side\.apt:") as refused:
        read(text)
    assert refused.value.line == line
    assert says in str(refused.value)


def test_a_file_without_points_and_one_in_the_wrong_unit():
    with pytest.raises(ImplausibleDataError, match="no point"):
        read("UNITS/MM\nPARTNO X\n")
    with pytest.raises(ImplausibleDataError, match=r"30\.0 m long, at most 20 m"):
        read("UNITS/MM\nGOTO/0,0,0\nGOTO/30000,0,0\n")


def test_a_machining_axis_system_of_its_own_is_told():
    rows = "$$*CATIA0\n$$ Axis\n$$ 1 0 0 25.0\n$$ 0 1 0 0\n$$ 0 0 1 0\n"
    path = read("UNITS/MM\n" + rows + "GOTO/1,2,3\n")
    assert "in a machining axis system" in path.notes[0]
