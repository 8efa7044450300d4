"""The canonical CSV: written and read back, and everything that can be wrong with one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.formats.measured_files import read_measurements, read_queries
from robotrue.measurement.measurement_set import MeasurementSet

HEADER = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,x_mm,y_mm,z_mm"
ROW = "10,-20,30,40,-50,60,1289.5,334.9,1027.3"


def written(folder: Path, text: str | bytes, name: str = "meas.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def message(path: Path) -> str:
    with pytest.raises(FormatError) as caught:
        read_measurements(path)
    return str(caught.value).replace(str(path), path.name)


def test_units_and_neutral_columns(tmp_path: Path) -> None:
    m = read_measurements(written(tmp_path, f"{HEADER}\n{ROW}\n"))
    np.testing.assert_allclose(m.joints[0] / DEG, [10, -20, 30, 40, -50, 60])
    np.testing.assert_allclose(m.position[0], [1.2895, 0.3349, 1.0273])
    # 15 um + 5 um/m at 3 m, read as two sigma.
    np.testing.assert_allclose(m.covariance[0], np.eye(3) * 15e-6**2)
    assert m.frame == "base"
    assert not m.has_rotation.any()
    assert m.group_names == ("meas",)
    assert m.source_row.tolist() == [2]
    assert m.sources[0].startswith("meas.csv sha256:")


def test_every_optional_group(tmp_path: Path) -> None:
    extra = (
        "rx_deg,ry_deg,rz_deg,sx_mm,sy_mm,sz_mm,fx_N,fy_N,fz_N,mx_Nm,my_Nm,mz_Nm,"
        "approach1,approach2,approach3,approach4,approach5,approach6,temperature_C,payload_kg,"
        "target,station,set"
    )
    values = "1,2,3,.01,.02,.03,1,2,3,4,5,6,-1,0,1,1,1,1,21.5,12,2,1,morning"
    m = read_measurements(written(tmp_path, f"{HEADER},{extra}\n{ROW},{values}\n"))
    np.testing.assert_allclose(m.rotation[0], matrix_from_abc(np.array([3, 2, 1]) * DEG))
    np.testing.assert_allclose(np.sqrt(np.diag(m.covariance[0])) / MM, [0.01, 0.02, 0.03])
    assert m.wrench[0].tolist() == [1, 2, 3, 4, 5, 6]
    assert m.approach[0].tolist() == [-1, 0, 1, 1, 1, 1]
    assert m.temperature[0] == pytest.approx(294.65)
    assert m.payload_mass[0] == 12.0
    assert (m.target[0], m.station[0], m.group_names) == (2, 1, ("morning",))


def test_names_in_any_case_order_and_padding(tmp_path: Path) -> None:
    names = [f" {name.upper()} " for name in HEADER.split(",")][::-1]
    values = ROW.split(",")[::-1]
    m = read_measurements(written(tmp_path, ",".join(names) + "\n" + ",".join(values)))
    plain = read_measurements(written(tmp_path, f"{HEADER}\n{ROW}\n", "plain.csv"))
    np.testing.assert_array_equal(m.joints, plain.joints)
    np.testing.assert_array_equal(m.position, plain.position)


@pytest.mark.parametrize("mark", [";", "\t", ",", "|", "  "])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_delimiters_encodings_and_line_ends(
    tmp_path: Path, mark: str, encoding: str, end: str
) -> None:
    text = f"{HEADER}{end}{ROW}{end}{ROW}".replace(",", mark)
    m = read_measurements(written(tmp_path, text.encode(encoding)))
    np.testing.assert_allclose(m.position / MM, [[1289.5, 334.9, 1027.3]] * 2)
    assert m.source_row.tolist() == [2, 3]


def test_decimal_comma(tmp_path: Path) -> None:
    text = f"{HEADER}\n{ROW}\n".replace(",", ";").replace(".", ",")
    m = read_measurements(written(tmp_path, text))
    np.testing.assert_allclose(m.position[0] / MM, [1289.5, 334.9, 1027.3])


def test_one_date_does_not_decide_the_decimal_mark(tmp_path: Path) -> None:
    text = f"{HEADER},set\n{ROW},9.30\n".replace(",", ";")
    text = text.replace("1289.5;334.9;1027.3", "1289,5;334,9;1027,3")
    m = read_measurements(written(tmp_path, text))
    np.testing.assert_allclose(m.position[0] / MM, [1289.5, 334.9, 1027.3])
    assert m.group_names == ("9.30",)


def test_comments_and_blank_lines_keep_line_numbers(tmp_path: Path) -> None:
    text = f"# station 1\n\n{HEADER}\n{ROW}\n\n{ROW}\n,,,,,,,,\n"
    assert read_measurements(written(tmp_path, text)).source_row.tolist() == [4, 6]


def test_seven_joints(tmp_path: Path) -> None:
    header = HEADER.replace("j6_deg", "j6_deg,j7_deg")
    assert read_measurements(written(tmp_path, f"{header}\n1,{ROW}\n")).dof == 7


def test_workbook_is_read_like_the_csv(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append([*HEADER.split(","), "set"])
    book.active.append([*(float(v) for v in ROW.split(",")), 3])
    book.create_sheet("empty")
    book.save(tmp_path / "meas.xlsx")
    m = read_measurements(tmp_path / "meas.xlsx")
    plain = read_measurements(written(tmp_path, f"{HEADER}\n{ROW}\n"))
    np.testing.assert_array_equal(m.position, plain.position)
    assert m.group_names == ("3",)
    book.create_sheet("notes").append(["air was warm"])
    book.save(tmp_path / "two.xlsx")
    assert message(tmp_path / "two.xlsx") == (
        "two.xlsx: 2 sheets with values: Sheet, notes. "
        "Try: name one of them in the mapping (worksheet=...), or save it alone."
    )
    data = (tmp_path / "meas.xlsx").read_bytes()
    assert "not a workbook, or damaged" in message(written(tmp_path, data[:900], "cut.xlsx"))


BAD = {
    "unknown": (
        f"{HEADER},fx_Nm\n{ROW},1\n",
        "meas.csv:1: unknown column 'fx_Nm'; allowed are ",
        "Try: rename it to 'fx_N', or remove it.",
    ),
    "missing": (
        HEADER.replace(",z_mm", "") + "\n1,2,3,4,5,6,7,8\n",
        "meas.csv:1: no column 'z_mm'; the file has j1_deg,",
        "",
    ),
    "gap in the joints": (
        HEADER.replace("j3_deg,", "") + "\n1,2,4,5,6,7,8,9\n",
        "meas.csv:1: no column 'j3_deg'",
        "",
    ),
    "half a group": (
        f"{HEADER},fx_N,fz_N\n{ROW},1,2\n",
        "meas.csv:1: no column 'fy_N'",
        "",
    ),
    "nan": (
        f"{HEADER}\n{ROW}\n1,2,3,4,5,6,7,nan,9\n",
        "meas.csv:3: column 'y_mm' is 'nan', expected a finite number.",
        "Try: correct or delete that row.",
    ),
    "blank": (
        f"{HEADER}\n1,2,,4,5,6,7,8,9\n",
        "meas.csv:2: column 'j3_deg' is blank, expected a number.",
        "",
    ),
    "text": (
        f"{HEADER}\n1,2,n/a,4,5,6,7,8,9\n",
        "meas.csv:2: column 'j3_deg' is 'n/a', expected a finite number.",
        "",
    ),
    "underscore": (
        f"{HEADER}\n1,2,1_0,4,5,6,7,8,9\n",
        "meas.csv:2: column 'j3_deg' is '1_0', expected a finite number.",
        "",
    ),
    "thousands": (
        f"{HEADER}\n{ROW}\n".replace(",", ";").replace("1289.5", "1.289,5"),
        "meas.csv:2: column 'x_mm' is '1.289,5', expected a number with decimal mark '.'",
        "",
    ),
    "cut off": (
        f"{HEADER}\n{ROW}\n1,2,3,4,5",
        "meas.csv:3: 5 columns, expected 9: the file ends in the middle of its last line.",
        "Try: copy or export the file again.",
    ),
    "ragged": (
        f"{HEADER}\n1,2,3\n{ROW}\n",
        "meas.csv:2: 3 columns, expected 9.",
        "Try: look for a missing delimiter.",
    ),
    "too wide": (f"{HEADER}\n{ROW},1\n{ROW}\n", "meas.csv:2: 10 columns, expected 9.", ""),
    "twice": (
        f"{HEADER},X_mm\n{ROW},1\n",
        "meas.csv:1: column 'X_mm' appears twice: columns 7 and 10.",
        "Try: rename or remove one of them.",
    ),
    "nameless": (f"{HEADER},\n{ROW},5\n", "meas.csv:1: column 10 has no name.", ""),
    "no header": (
        f"{ROW}\n{ROW}\n",
        "meas.csv:1: the first line holds numbers (10, ...), expected column names.",
        "Try: add a header line",
    ),
    "empty": ("", "meas.csv: the file is empty.", ""),
    "comments only": ("# nothing\n", "meas.csv: no rows with values.", ""),
    "header only": (HEADER, "meas.csv:1: a header and no rows.", ""),
    "other layout": (
        "time,a,b\n1,2,3\n",
        "meas.csv:1: columns of no known layout: time, a, b.",
        "Try: name them j1_deg..j6_deg, x_mm, y_mm, z_mm, or give a mapping.",
    ),
    "quotation": (
        f'{HEADER}\n{ROW}\n"1,2,3,4,5,6,7,8,9\n',
        "meas.csv:3: cannot be split into columns",
        "Try: look for a stray quotation mark.",
    ),
    "zero sigma": (
        f"{HEADER},sx_mm,sy_mm,sz_mm\n{ROW},.1,0,.1\n",
        "meas.csv:2: column 'sy_mm' is 0, expected above 0.",
        "",
    ),
    "approach": (
        f"{HEADER},{','.join(f'approach{i}' for i in range(1, 7))}\n{ROW},0,0,2,0,0,0\n",
        "meas.csv:2: column 'approach3' is 2, expected -1, 0 or 1.",
        "",
    ),
    "target": (
        f"{HEADER},target\n{ROW},1.5\n",
        "meas.csv:2: column 'target' is 1.5, expected a number 0, 1, 2 ....",
        "",
    ),
    "payload": (
        f"{HEADER},payload_kg\n{ROW},-3\n",
        "meas.csv:2: column 'payload_kg' is -3, expected 0 or more.",
        "",
    ),
    "set": (f"{HEADER},set\n{ROW}, \n", "meas.csv:2: column 'set' is blank, expected a name.", ""),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_named_with_line_and_column(tmp_path: Path, case: str) -> None:
    text, start, end = BAD[case]
    found = message(written(tmp_path, text))
    assert found.startswith(start)
    assert end in found


def test_damaged_bytes_among_the_numbers(tmp_path: Path) -> None:
    data = f"{HEADER}\n{ROW}\n".encode() + b"1,2,3,4,5,6,7,\xff8,9\n"
    assert message(written(tmp_path, data)) == (
        "meas.csv:3: byte 0xff is not UTF-8: damage or another encoding. "
        'Try: state the encoding in the mapping (encoding = "cp1252"), or export as UTF-8.'
    )


def test_zero_bytes(tmp_path: Path) -> None:
    assert "meas.csv:2: holds zero bytes" in message(
        written(tmp_path, f"{HEADER}\n".encode() + b"\0" * 40)
    )


def test_no_such_file(tmp_path: Path) -> None:
    assert message(tmp_path / "none.csv") == (
        "none.csv: cannot read: No such file or directory. Try: check the path."
    )


def test_ignore_lets_named_columns_pass(tmp_path: Path) -> None:
    path = written(tmp_path, f"{HEADER},comment,when\n{ROW},ok,9:00\n")
    assert len(read_measurements(path, ignore=("comment", "When"))) == 1
    with pytest.raises(FormatError, match="unknown column 'when'"):
        read_measurements(path, ignore=("comment",))


def test_queries_need_joints_only(tmp_path: Path) -> None:
    path = written(tmp_path, "j1_deg,j2_deg,fx_N,fy_N,fz_N\n90,0,1,2,3\n")
    queries = read_queries(path)
    np.testing.assert_allclose(queries.joints, [[np.pi / 2, 0.0]])
    assert queries.wrench.tolist() == [[1, 2, 3, 0, 0, 0]]
    assert np.isnan(queries.payload_mass).all()
    assert len(queries) == 1
    with pytest.raises(FormatError, match="unknown column 'fx'"):
        read_queries(written(tmp_path, "j1_deg,j2_deg,fx\n1,2,3\n", "bad.csv"))


finite = st.floats(-1e4, 1e4, allow_nan=False)


@st.composite
def measurement_sets(draw: st.DrawFn) -> MeasurementSet:
    n, dof = draw(st.integers(1, 5)), draw(st.integers(1, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = rng.normal(size=(n, 3, 3)) * 1e-4 + 1e-4 * np.eye(3)
    some = {
        "rotation": matrix_from_abc(rng.uniform(-1.5, 1.5, (n, 3))),
        "wrench": rng.normal(size=(n, 6)) * 100,
        "approach": rng.choice([-1.0, 0.0, 1.0], (n, dof)),
        "temperature": rng.uniform(280, 310, n),
        "payload_mass": rng.uniform(0, 100, n),
        "payload_com": rng.normal(size=(n, 3)),
        "target": rng.integers(0, 4, n),
        "station": rng.integers(0, 3, n),
    }
    chosen = draw(st.sets(st.sampled_from(sorted(some))))
    return MeasurementSet(
        joints=np.array(draw(st.lists(finite, min_size=n * dof, max_size=n * dof))).reshape(n, dof),
        position=np.array(draw(st.lists(finite, min_size=n * 3, max_size=n * 3))).reshape(n, 3),
        covariance=root @ np.swapaxes(root, 1, 2) + 1e-10 * np.eye(3),
        group_names=("only one",),
        sources=("x sha256:0",),
        **{name: some[name] for name in chosen},
    )


@settings(max_examples=60, deadline=None, derandomize=True)
@given(measurements=measurement_sets())
def test_write_and_read_give_the_same_set(
    tmp_path_factory: pytest.TempPathFactory, measurements: MeasurementSet
) -> None:
    path = tmp_path_factory.mktemp("round") / "set.csv"
    write_canonical(path, measurements)
    again = read_measurements(path)
    for name in (
        "joints position covariance rotation wrench approach temperature payload_mass payload_com "
        "target station"
    ).split():
        np.testing.assert_allclose(
            getattr(again, name), getattr(measurements, name), rtol=1e-12, atol=1e-15, err_msg=name
        )
    assert again.group_names == measurements.group_names


def test_half_known_orientation_is_not_written(tmp_path: Path) -> None:
    rotation = np.stack([np.eye(3), np.full((3, 3), np.nan)])
    m = MeasurementSet(
        joints=np.zeros((2, 6)),
        position=np.zeros((2, 3)),
        covariance=np.tile(np.eye(3) * 1e-10, (2, 1, 1)),
        rotation=rotation,
    )
    with pytest.raises(FormatError, match="orientation is known for 1 of 2 rows"):
        write_canonical(tmp_path / "out.csv", m)
    assert not (tmp_path / "out.csv").exists()


def test_axes_as_the_controller_displays_them(tmp_path: Path) -> None:
    """In place of joints they are read by the robot; beside joints they are for people alone."""
    shown = HEADER.replace("j", "a")
    path = written(tmp_path, f"{shown}\n{ROW}\n")
    m = read_measurements(path, relation=lambda axes: -axes)
    np.testing.assert_allclose(m.joints[0] / DEG, [-10, 20, -30, -40, 50, -60])
    assert "no robot states their convention" in message(path)
    both = f"{HEADER},{shown.partition(',x_mm')[0]}\n{ROW},1,2,3,4,5,6\n"
    m = read_measurements(written(tmp_path, both))
    np.testing.assert_allclose(m.joints[0] / DEG, [10, -20, 30, 40, -50, 60])
