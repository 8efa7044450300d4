"""Responses from files: round trips, and every file that must be refused."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import measured, robot_with_tool, single
from scipy.io import savemat

from robotrue.dynamics.formats.frf_table import read_frf, write_frf_csv
from robotrue.dynamics.formats.uff import read_uff, write_uff
from robotrue.dynamics.frf import in_form, trusted_lines
from robotrue.errors import FormatError, ImplausibleDataError

pyuff = pytest.importorskip("pyuff")

FRF = replace(trusted_lines(measured(robot_with_tool(), highest=200.0)), measured_as="receptance")
LINES = FRF.frequency


def rows(values, form="receptance"):
    """CSV lines of one pair in a form."""
    raw = in_form(values, LINES, "receptance", form)
    return "".join(f"{f:.6g},{g.real:.9e},{g.imag:.9e}\n" for f, g in zip(LINES, raw, strict=True))


def written(tmp_path, text, name="FRF.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_csv_there_and_back(tmp_path):
    coherence = np.full(FRF.response.shape, 0.97)
    frf = replace(FRF, coherence=coherence)
    write_frf_csv(tmp_path / "FRF.csv", frf)
    again = read_frf(tmp_path / "FRF.csv")
    np.testing.assert_allclose(again.response, frf.response, rtol=1e-7)
    np.testing.assert_allclose(again.frequency, frf.frequency, rtol=1e-8)
    np.testing.assert_allclose(again.coherence, coherence)
    assert again.pairs == frf.pairs
    assert again.valid == (4.0, 200.0)
    assert again.static is None


def test_csv_keeps_the_static_deflection_at_0_hz(tmp_path):
    static = robot_with_tool().modal_static
    write_frf_csv(tmp_path / "FRF.csv", replace(FRF, static=static))
    again = read_frf(tmp_path / "FRF.csv")
    np.testing.assert_allclose(again.static, static, rtol=1e-7)
    assert again.valid[0] == 0.0


def test_response_axis_comes_first(tmp_path):
    text = "f_Hz,Gyx_re_m_per_N,Gyx_im_m_per_N\n" + rows(FRF.pair("y", "x"))
    frf = read_frf(written(tmp_path, text))
    assert frf.response_axes == ("y",)
    assert frf.excitation_axes == ("x",)


@pytest.mark.parametrize(
    ("unit", "form", "scale"),
    [
        ("m_per_s2_per_N", "accelerance", 1.0),
        ("m_per_s_per_N", "mobility", 1.0),
        ("um_per_N", "receptance", 1e6),
        ("mm_per_N", "receptance", 1e3),
    ],
)
def test_units_in_the_name(tmp_path, unit, form, scale):
    text = f"f_Hz,Gxx_re_{unit},Gxx_im_{unit}\n" + rows(scale * FRF.pair("x", "x"), form)
    frf = read_frf(written(tmp_path, text))
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"), rtol=1e-5)
    assert frf.measured_as == form
    assert frf.valid[0] == 4.0


def test_semicolons_and_decimal_commas(tmp_path):
    body = rows(FRF.pair("x", "x")).replace(",", ";").replace(".", ",")
    frf = read_frf(written(tmp_path, "# lab 3\nf_Hz;Gxx_re_m_per_N;Gxx_im_m_per_N\n" + body))
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"), rtol=1e-5)


HEAD = "f_Hz,Gxx_re_m_per_N,Gxx_im_m_per_N\n"
GOOD = rows(FRF.pair("x", "x"))


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("f_Hz,Gxx_re,Gxx_im\n" + GOOD, 1, "'Gxx_re' has no unit"),
        ("f,Gxx_re_m_per_N,Gxx_im_m_per_N\n" + GOOD, 1, "column 'f' is not known"),
        ("f_Hz,Gxx_re_m_per_N,Gxw_im_m_per_N\n" + GOOD, 1, "'Gxw_im_m_per_N' is not known"),
        ("f_Hz,Gxx_re_m_per_N,Gyy_im_m_per_N\n" + GOOD, 1, "has only its re part"),
        ("f_Hz,Gxx_re_m_per_N,Gxx_im_um_per_N\n" + GOOD, 1, "two units"),
        ("f_Hz,Gxx_re_m_per_N,Gxx_re_m_per_N\n" + GOOD, 1, "'Gxx_re_m_per_N' appears twice"),
        (GOOD, 1, "holds numbers"),
        (HEAD, 1, "a header and no rows"),
        ("", None, "the file is empty"),
        (HEAD + GOOD + "4.0,1e-7,1e-9\n", 395, "it has to rise"),
        (HEAD + "1,2\n" + GOOD, 2, "2 columns, expected 3"),
        (HEAD + "1,nan,0\n" + GOOD, 2, "Gxx_re_m_per_N is nan"),
        (HEAD + "1,,0\n" + GOOD, 2, "Gxx_re_m_per_N is blank"),
        (HEAD + "1,1e-7,inf\n" + GOOD, 2, "Gxx_im_m_per_N is inf"),
        (HEAD + "".join(GOOD.splitlines(keepends=True)[:5]), None, "5 lines above 0 Hz"),
    ],
)
def test_csv_refused(tmp_path, text, line, said):
    with pytest.raises(FormatError) as caught:
        read_frf(written(tmp_path, text))
    assert said in str(caught.value)
    assert caught.value.line == line
    assert str(tmp_path / "FRF.csv") in str(caught.value)


def test_a_file_that_ends_in_the_middle_of_a_line(tmp_path):
    cut = HEAD + GOOD[: GOOD.rindex(",")]
    with pytest.raises(FormatError, match="ends in the middle of its last line"):
        read_frf(written(tmp_path, cut + "\n"))


def test_accelerance_under_the_name_of_a_receptance(tmp_path):
    with pytest.raises(ImplausibleDataError, match="accelerance"):
        read_frf(written(tmp_path, HEAD + rows(FRF.pair("x", "x"), "accelerance")))


def test_integrated_noise_is_not_trusted(tmp_path):
    """A receptance that somebody integrated from an accelerometer: blind below 4 Hz, too."""
    f = np.arange(0.5, 200.0, 0.5)
    noise = 1e-5 / f**2
    g = single().response(f)[:, 0, 0] + noise
    body = "".join(f"{a:.6g},{b.real:.9e},{b.imag:.9e}\n" for a, b in zip(f, g, strict=True))
    assert read_frf(written(tmp_path, HEAD + body)).valid == (4.0, 199.5)


def test_a_coherence_in_per_cent(tmp_path):
    text = "f_Hz,Gxx_re_m_per_N,Gxx_im_m_per_N,Cxx\n" + GOOD.replace("\n", ",97\n")
    with pytest.raises(ImplausibleDataError, match="coherence Cxx goes from 97 to 97"):
        read_frf(written(tmp_path, text))


def test_binary_is_no_csv(tmp_path):
    path = tmp_path / "FRF.csv"
    path.write_bytes(b"f_Hz,\xff\xfe\n")
    with pytest.raises(FormatError, match="0xff is not UTF-8"):
        read_frf(path)


def test_unknown_suffix(tmp_path):
    with pytest.raises(FormatError, match=r"suffix '\.xls' is not known"):
        read_frf(written(tmp_path, GOOD, "FRF.xls"))


def test_uff_there_and_back(tmp_path):
    frf = replace(FRF, coherence=np.full(FRF.response.shape, 0.9))
    write_uff(tmp_path / "FRF.uff", frf)
    again = read_frf(tmp_path / "FRF.uff")
    np.testing.assert_allclose(again.response, frf.response, rtol=1e-10)
    np.testing.assert_allclose(again.coherence, frf.coherence)
    np.testing.assert_allclose(again.frequency, frf.frequency, rtol=1e-6)
    assert again.measured_as == "receptance"


def test_uneven_lines_survive_uff(tmp_path):
    keep = np.unique(np.geomspace(1, len(LINES) - 1, 100).astype(int))
    frf = replace(
        FRF, frequency=LINES[keep], response=FRF.response[keep], valid=(LINES[keep][0], 200.0)
    )
    write_uff(tmp_path / "FRF.uff", frf)
    again = read_uff(tmp_path / "FRF.uff")
    np.testing.assert_allclose(again.frequency, frf.frequency, rtol=1e-5)
    np.testing.assert_allclose(again.response, frf.response, rtol=1e-10)


def set_58(values, **change):
    """One data set as a measuring system writes it."""
    return {
        "type": 58, "binary": 0, "func_type": 4, "ver_num": 0, "load_case_id": 0,
        "rsp_ent_name": "NONE", "rsp_node": 1, "rsp_dir": 1, "ref_ent_name": "NONE",
        "ref_node": 1, "ref_dir": 1, "id1": "FRF", "ord_data_type": 6,
        "num_pts": len(LINES), "abscissa_spacing": 1, "abscissa_min": float(LINES[0]),
        "abscissa_inc": 0.5, "z_axis_value": 0.0, "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": 12, "ordinate_axis_units_lab": "m/s^2",
        "orddenom_spec_data_type": 13, "orddenom_axis_units_lab": "N",
        "x": LINES, "data": values,
    } | change  # fmt: skip


ACCELERANCE = in_form(FRF.pair("x", "x"), LINES, "receptance", "accelerance")


def uff(tmp_path, *sets):
    path = tmp_path / "test.uff"
    for one in sets:
        pyuff.UFF(str(path)).write_sets(one, "add")
    return path


def test_uff_of_an_accelerometer(tmp_path):
    frf = read_uff(uff(tmp_path, set_58(ACCELERANCE)))
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"), rtol=1e-6)
    assert frf.measured_as == "accelerance"


def test_uff_in_g_and_against_the_axis(tmp_path):
    one = set_58(-ACCELERANCE / 9.80665, ordinate_axis_units_lab="g", rsp_dir=-1)
    frf = read_uff(uff(tmp_path, one))
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"), rtol=1e-6)


def test_uff_units_of_set_164(tmp_path):
    units = {
        "type": 164, "units_code": 5, "units_description": "mm and N", "temp_mode": 1,
        "length": 1000.0, "force": 1.0, "temp": 1.0, "temp_offset": 0.0,
    }  # fmt: skip
    one = set_58(1e3 * ACCELERANCE, ordinate_axis_units_lab="", orddenom_axis_units_lab="")
    frf = read_uff(uff(tmp_path, units, one))
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"), rtol=1e-6)


@pytest.mark.parametrize(
    ("sets", "error", "said"),
    [
        ([set_58(ACCELERANCE, ordinate_axis_units_lab="")], FormatError, "has no unit"),
        ([set_58(ACCELERANCE, rsp_dir=4)], FormatError, "direction 4 of the response"),
        ([set_58(ACCELERANCE, ordinate_spec_data_type=0)], FormatError, "data type 0 over 13"),
        ([set_58(ACCELERANCE), set_58(ACCELERANCE)], FormatError, "xx for the second time"),
        ([set_58(ACCELERANCE, func_type=1, ord_data_type=4, data=ACCELERANCE.real)],
         FormatError, "no frequency response in it"),
        ([set_58(ACCELERANCE, ordinate_spec_data_type=8, ordinate_axis_units_lab="m")],
         ImplausibleDataError, "accelerance"),
        ([set_58(ACCELERANCE), set_58(FRF.pair("y", "x"), rsp_dir=2, ordinate_spec_data_type=8,
                                      ordinate_axis_units_lab="m")],
         FormatError, "curves of accelerance and receptance"),
    ],
)  # fmt: skip
def test_uff_refused(tmp_path, sets, error, said):
    with pytest.raises(error, match=said):
        read_uff(uff(tmp_path, *sets))


def test_uff_that_is_none(tmp_path):
    with pytest.raises(FormatError, match="not a universal file"):
        read_uff(written(tmp_path, "hello\n", "a.uff"))
    with pytest.raises(FormatError, match="cannot be read as a universal file"):
        read_uff(written(tmp_path, "    -1\n    58\nrubbish\n    -1\n", "b.uff"))


def test_mat_there(tmp_path):
    path = tmp_path / "FRF.mat"
    savemat(path, {"f_Hz": LINES, "Gxx_m_per_N": FRF.pair("x", "x"), "Cxx": np.ones(len(LINES))})
    frf = read_frf(path)
    np.testing.assert_allclose(frf.pair("x", "x"), FRF.pair("x", "x"))
    savemat(path, {"f_Hz": LINES, "G_m_per_N": FRF.response})
    np.testing.assert_allclose(read_frf(path).response, FRF.response)


@pytest.mark.parametrize(
    ("variables", "said"),
    [
        ({"Gxx_m_per_N": FRF.pair("x", "x")}, "no variable f_Hz"),
        ({"f_Hz": LINES, "Gxx": FRF.pair("x", "x")}, "Gxx has no unit"),
        ({"f_Hz": LINES, "Gxx_furlong": FRF.pair("x", "x")}, "Gxx_furlong has no unit"),
        ({"f_Hz": LINES, "Gxx_m_per_N": np.ones(3)}, "has 3 values, expected 393"),
        ({"f_Hz": LINES, "Gxx_m_per_N": np.full(393, np.nan)}, "sample 0 of Gxx_m_per_N is"),
        ({"f_Hz": LINES, "G_m_per_N": np.ones((5, 3, 3))}, "has shape"),
    ],
)
def test_mat_refused(tmp_path, variables, said):
    path = tmp_path / "FRF.mat"
    savemat(path, variables)
    with pytest.raises(FormatError, match=said):
        read_frf(path)


def test_mat_that_is_none(tmp_path):
    with pytest.raises(FormatError, match="cannot be read as a MAT file"):
        read_frf(written(tmp_path, "hello", "FRF.mat"))
    path = tmp_path / "new.mat"
    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(FormatError, match=r"version 7\.3"):
        read_frf(path)


def test_missing_library_is_named(tmp_path, monkeypatch):
    import sys

    from robotrue.errors import MissingExtraError

    path = uff(tmp_path, set_58(ACCELERANCE))
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(MissingExtraError, match=r"robotrue\[dynamics\]"):
        read_uff(path)


def test_one_mode_of_an_accelerometer_has_no_static_value():
    assert measured(single()).static is None


@pytest.mark.parametrize("part", [0.6, 0.95, 0.9999])
def test_a_universal_file_cut_short_is_refused_and_not_read_without_its_last_curve(tmp_path, part):
    path = tmp_path / "response.uff"
    write_uff(path, measured(single(), highest=400.0))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * part)])
    with pytest.raises(FormatError, match="ends in the middle of its last set"):
        read_uff(path)
