"""Tool paths: the same points however they are printed, and damage that never passes silently."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.units import MM
from robotrue.errors import FormatError, ImplausibleDataError
from robotrue.program.formats.apt import read_apt
from robotrue.program.formats.toolpath_csv import read_toolpath_csv
from robotrue.program.outline import area, inside, outer_boundaries

SAMPLE = b"""$$*CATIA0
$$ Axis.1
$$ 1.0 0.0 0.0 0.0
$$ 0.0 1.0 0.0 0.0
$$ 0.0 0.0 1.0 0.0
PARTNO PART
UNITS/MM
LOADTL/1
SPINDL/ 9000.0,RPM,CLW
MULTAX/ON
FROM/0,0,100
RAPID
GOTO  /  10.0, 20.0, 30.0,$
 0.0, 0.0, 1.0
FEDRAT/ 300.0,MMPM
GOTO/10,20,0
CIRCLE/ 0,20,0,0,0,1,10
GOTO/ -10,20,0
INDIRV/ 0,1,0
TLON,GOFWD/ (CIRCLE/ -20,20,0,10),ON,(LINE/ -20,20,0,-30,20,0)
GODLTA/ 0,0,5
END-OF-PATH
FINI
"""
PIECES = [
    *(b"/", b",", b"$", b"$$", b"(", b")", b"\n", b"\r", b".", b"-", b"E9", b"\xff", b"\x00", b"0"),
    *(b"GOTO/", b"CIRCLE/", b"UNITS/INCHES\n", b"MULTAX/OFF\n", b"RAPID\n", b"FEDRAT/1,MMPR\n"),
    *(b"TRANS/1\n", b"INDIRV/1,0,0\n", b"9" * 20, b"1E300", b"$$*CATIA0\n", b"nan", b"LOADTL/2\n"),
]
NUMBER = st.integers(-400_000, 400_000)
SPACE = st.sampled_from(["", " ", "   ", "$\n", " $ $$ why\n  "])


@st.composite
def printed(draw) -> tuple[str, str, np.ndarray]:
    """The same points as APT in some dress, as CSV, and as numbers (mm)."""
    points = draw(st.lists(st.tuples(NUMBER, NUMBER, NUMBER), min_size=1, max_size=6))
    apt, table = ["UNITS/MM"], ["x_mm,y_mm,z_mm"]
    for point in points:
        words = [f"{draw(SPACE)}{v / 1000:.3f}" for v in point]
        head = draw(st.sampled_from(["GOTO/", "goto  /", "  GOTO /", "Goto/"]))
        apt.append(head + ",".join(words) + draw(st.sampled_from(["", " $$ note", "  "])))
        apt.extend(draw(st.sampled_from([[], ["$$ a comment"], ["PPRINT text / 1,2"], [""]])))
        table.append(",".join(f"{v / 1000:.3f}" for v in point))
    return "\n".join(apt), "\n".join(table), np.array(points) / 1000


@settings(max_examples=60, deadline=None)
@given(printed())
def test_dress_does_not_change_points(case) -> None:
    apt, table, points = case
    read = read_apt(apt.encode(), source="a.apt")
    np.testing.assert_allclose(read.position, points * MM, atol=1e-12)
    rows = read_toolpath_csv(table.encode(), source="a.csv")
    np.testing.assert_array_equal(rows.position, read.position)
    lines = apt.split("\n")
    assert all("/" in lines[line - 1] for line in read.line)


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_damage_is_refused_with_its_line_or_gives_finite_points(data) -> None:
    broken = bytearray(SAMPLE)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(broken)))
        cut = data.draw(st.integers(0, 12))
        broken[at : at + cut] = data.draw(st.sampled_from(PIECES))
    fault: FormatError | ImplausibleDataError | None = None
    try:
        path = read_apt(bytes(broken), source="broken.apt")
    except (FormatError, ImplausibleDataError) as refused:
        fault = refused
    if fault is None:
        assert np.isfinite(path.position).all()
        assert (np.diff(path.line) >= 0).all()
        return
    assert fault.source == "broken.apt"
    if isinstance(fault, FormatError):
        assert fault.line is not None
        assert 1 <= fault.line <= len(re.split(rb"\r\n|\n|\r", bytes(broken)))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(*[st.integers(0, 12)] * 4), min_size=1, max_size=8))
def test_the_outer_boundary_of_boxes_is_that_of_their_cells(boxes) -> None:
    """Rectangles on a grid, overlapping as they like: area and inside by counting cells."""
    grid = np.zeros((16, 16), dtype=bool)
    segments = []
    for x, y, w, h in boxes:
        a, b, c, d = x, y, min(x + 1 + w % 5, 15), min(y + 1 + h % 5, 15)
        grid[a:c, b:d] = True
        corners = [(a, b), (c, b), (c, d), (a, d)]
        segments += [[corners[k], corners[(k + 1) % 4]] for k in range(4)]
    loops = outer_boundaries(np.array(segments, dtype=float) * 0.01)
    outside = np.zeros((18, 18), dtype=bool)  # flood from the rim; touching corners do not leak
    outside[0] = outside[-1] = outside[:, 0] = outside[:, -1] = True
    blocked = np.pad(grid, 1)
    for _ in range(18 * 18):
        grown = outside.copy()
        grown[1:] |= outside[:-1]
        grown[:-1] |= outside[1:]
        grown[:, 1:] |= outside[:, :-1]
        grown[:, :-1] |= outside[:, 1:]
        grown &= ~blocked
        if (grown == outside).all():
            break
        outside = grown
    filled = ~outside[1:-1, 1:-1]
    x, y = np.meshgrid(np.arange(16) + 0.5, np.arange(16) + 0.5, indexing="ij")
    cells = np.stack([x.ravel(), y.ravel()], axis=1) * 0.01
    found = np.zeros(256, dtype=bool)
    for loop in loops:
        found |= inside(loop, cells)
    np.testing.assert_array_equal(found.reshape(16, 16), filled)
    assert sum(area(loop) for loop in loops) <= filled.sum() * 1e-4 + 1e-12
