"""Lines read by the shorter way, as the line before but for their numbers: nothing may differ."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.errors import FormatError
from robotrue.program.formats.krl_scan import Scan, scan

LINE = b"LIN {X 1.5,Y -2.25,Z 3.125,A 0.0,B 10.0,C -0.000} C_DIS\n"
ODD = [
    b"LIN {X 1.5,Y -2.25,Z 3.125,A 0.0,B 10.0,C 1E2} C_DIS\n",
    b"LIN {X 1.5,Y +2.25,Z 3.125,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X 1.5 ,Y 2.25,Z 3.125,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X  1.5,Y\t2.25,Z 3.125,A   0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X-1.5,Y 2.25,Z 3.125,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X .5,Y 2.,Z 3,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X 1234567890123456789.5,Y 2,Z 3,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X 12345678901234.5678,Y 2,Z 3.14159265358979323846,A 0.0,B 10.0,C 0.0} C_DIS\n",
    b"LIN {X 1.5,Y 2.5,Z 3.125,A 0.0,B 10.0,C 0.0} C_DIS ; LIN {X 1}\n",
    b"LIN {X 1.5,Y 2.5,Z 3.125,A 0.0,B 10.0,C 0.0}\n",
    b"LIN {X 1.5,Y 2.5,Z 3.125,A 0.0,B 10.0,C 0.0}\r\n",
    b"LIN {X 1.5,Y 2.5,Z 3.125,A 0.0,B 10.0,C 0.0}\r",
    b"LIN {X 1.5,Y 2.5+1,Z 3.125,A 0.0,B 10.0,C 0.0}\n",
    b"LIN {X x1,Y 2.5,Z 3.125,A 0.0,B 10.0,C 0.0}\n",
    b"LIN {X 1.5,Z 2.5}\n",
    b"lin {x 1.5,y 2.25,z 3.125,a 0.0,b 10.0,c 0.0} c_dis\n",
    b"  PTP {E6POS: X 1.5,Y 2,Z 3,A 0.0,B 10.0,C 0.0,S 2,T 35,E1 0.0,E2 -850.25} C_PTP\n",
    b"  PTP {E6POS: X 1.5,Y 2,Z 3,A 0.0,B 10.0,C 0.0,S'B010',T'B110101'} C_PTP\n",
    b"PTP {A1 0,A2 -90.0,A3 90.0,A4 0.0,A5 .0,A6 12}\n",
    b"CIRC {X 1,Y 2,Z 3},{X 4,Y 5,Z 6}\n",
    b"gf[1  ]={X 1,Y 2,Z 3,A 4,B 5,C 6}\n",
    b"$VEL.CP=0.5\n",
    b"; LIN {X 1.5,Y 2}\n",
    b"\n",
    b"",
]


def differing(data: bytes) -> list[str]:
    """Names of the columns that depend on the way of reading, or of the error."""
    found: list[Scan | str] = []
    for repeats in (True, False):
        try:
            found.append(scan(data, name="part.src", repeats=repeats))
        except FormatError as refused:
            found.append(str(refused))
    quick, whole = found
    if isinstance(quick, str) or isinstance(whole, str):
        return [] if quick == whole else ["error"]
    return [
        f.name
        for f in fields(Scan)
        if f.name != "data" and getattr(quick, f.name).tobytes() != getattr(whole, f.name).tobytes()
    ]


@pytest.mark.parametrize("first", [LINE, *ODD])
def test_pairs_of_lines(first: bytes) -> None:
    for odd in ODD:
        for data in (first + odd, first * 2 + odd * 2 + first, odd * 3 + LINE):
            assert differing(data) == []
            assert differing(data[:-3]) == []


number = st.from_regex(rb"[-+]?\d{0,5}\.?\d{0,6}(E-?\d)?", fullmatch=True)


@settings(max_examples=120, deadline=None)
@given(st.lists(st.lists(number, min_size=6, max_size=6), min_size=2, max_size=6), st.data())
def test_lines_of_any_numbers(rows: list[list[bytes]], data: st.DataObject) -> None:
    text = b"".join(b"LIN {X %b,Y %b,Z %b,A %b,B %b,C %b} C_DIS\n" % tuple(row) for row in rows)
    assert differing(text) == []
    at = data.draw(st.integers(0, len(text)))
    assert differing(text[:at]) == []
    assert differing(text[:at] + data.draw(st.binary(min_size=1, max_size=3)) + text[at:]) == []


def test_a_run_of_lines_is_read_by_the_shorter_way() -> None:
    rng = np.random.default_rng(2)
    rows = rng.uniform(-900.0, 900.0, (400, 6)).tolist()
    text = "".join(
        "LIN {{X {:.3f},Y {:.3f},Z {:.3f},A {:.3f},B {:.3f},C {:.3f}}}\n".format(*r) for r in rows
    )
    found = scan(text.encode(), name="part.src")
    assert found.tok_value.reshape(-1, 6).tolist() == [[round(v, 3) for v in r] for r in rows]
    assert differing(text.encode()) == []
