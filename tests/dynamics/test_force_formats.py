"""Force records from files, and sensors that cannot be right."""

import numpy as np
import pytest
from scipy.io import savemat

from robotrue.dynamics.force import ForceRecord, check_force
from robotrue.dynamics.formats.column_table import even_rate
from robotrue.dynamics.formats.signal_table import read_force, write_force_csv
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError

nptdms = pytest.importorskip("nptdms")

N = 400
T = np.arange(N) / 5000.0
RNG = np.random.default_rng(5)
FORCE = 40.0 * np.sin(2 * np.pi * 60.0 * T)[:, None] * [1.0, -0.5, 0.2] + RNG.normal(size=(N, 3))


def csv(tmp_path, force=FORCE, time=T, head="t_s,fx_N,fy_N,fz_N"):
    path = tmp_path / "FORCE.csv"
    body = "\n".join(
        ",".join(f"{v:.9g}" for v in row) for row in np.column_stack([time, force]).tolist()
    )
    path.write_text(f"{head}\n{body}\n", encoding="utf-8")
    return path


def test_csv_there_and_back(tmp_path):
    record = ForceRecord(start=1.5, rate=5000.0, force=FORCE, source="here")
    write_force_csv(tmp_path / "FORCE.csv", record)
    again, odd = read_force(tmp_path / "FORCE.csv")
    np.testing.assert_allclose(again.force, FORCE, rtol=1e-8)
    assert again.rate == pytest.approx(5000.0)
    assert again.start == pytest.approx(1.5)
    assert odd == ()


def test_columns_in_any_order(tmp_path):
    path = csv(tmp_path, FORCE[:, ::-1], head="t_s,fz_N,fy_N,fx_N")
    np.testing.assert_allclose(read_force(path)[0].force, FORCE, rtol=1e-8)


def test_times_of_few_digits_are_an_even_clock(tmp_path):
    rate = 12800.0
    record, _ = read_force(csv(tmp_path, time=np.round(np.arange(N) / rate, 5)))
    assert record.rate == pytest.approx(rate, rel=1e-3)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("t_s,fx,fy,fz", "column 'fx' in another unit or in none"),
        ("t_s,fx_kN,fy_kN,fz_kN", "column 'fx_kN' in another unit or in none"),
        ("t_ms,fx_N,fy_N,fz_N", "column 't_ms' in another unit or in none"),
        ("t_s,fx_N,fy_N,torque_Nm", "column 'torque_Nm' is not known"),
    ],
)
def test_units_refused(tmp_path, head, said):
    with pytest.raises(FormatError, match=said) as caught:
        read_force(csv(tmp_path, head=head))
    assert caught.value.line == 1


def test_a_force_that_was_not_measured_is_not_zero(tmp_path):
    with pytest.raises(FormatError, match="no column fz_N"):
        read_force(csv(tmp_path, FORCE[:, :2], head="t_s,fx_N,fy_N"))


def spoil(rows, column, value):
    force = FORCE.copy()
    force[rows, column] = value
    return force


@pytest.mark.parametrize(
    ("force", "line", "said"),
    [
        (spoil(200, 1, np.nan), 202, "fy_N is nan"),
        (np.rint(FORCE * 200.0), None, "counts of a converter"),
        (FORCE * 1e4, None, "expected at most 50000"),
        (np.clip(FORCE, -20.0, 20.0), None, "the sensor is saturated"),
        (spoil(slice(None), 2, 3.25), 2, "fz is 3.25 N on every sample"),
        (np.zeros((N, 3)), 2, "all forces are zero"),
    ],
)
def test_sensors_that_cannot_be_right(tmp_path, force, line, said):
    with pytest.raises((FormatError, ImplausibleDataError), match=said) as caught:
        read_force(csv(tmp_path, force))
    assert caught.value.line is not None
    if line is not None:
        assert caught.value.line == line
    assert caught.value.hint


def test_what_looks_odd_and_is_not(tmp_path):
    """No force along an axis, none between the teeth, a step: sound."""
    _, odd = read_force(csv(tmp_path, spoil(slice(None), 2, 0.0)))
    assert "fz is zero throughout" in odd[0]
    between = np.maximum(FORCE, 0.0)
    assert check_force(ForceRecord(start=0.0, rate=1.0, force=between, source="")) == ()
    step = np.zeros((N, 3))
    step[50:, 0] = 100.0
    assert len(check_force(ForceRecord(start=0.0, rate=1.0, force=step, source=""))) == 2


@pytest.mark.parametrize(
    ("time", "line", "said"),
    [
        (np.delete(np.arange(N + 3) / 5000.0, [100, 101, 102]), 102, "about 3 missing"),
        (np.r_[T[:50], T[49:-1]], 52, "duplicated or reordered"),
        (np.r_[T[:50], T[50:][::-1]], 53, "duplicated or reordered"),
        (T + 0.3 / 5000.0 * np.sin(np.arange(N)), None, "an uneven clock"),
    ],
)
def test_clocks_refused(tmp_path, time, line, said):
    with pytest.raises(ImplausibleDataError, match=said) as caught:
        read_force(csv(tmp_path, time=time))
    assert caught.value.line is not None
    if line is not None:
        assert caught.value.line == line


def test_one_sample_has_no_clock():
    with pytest.raises(ImplausibleDataError, match="1 sample, expected two"):
        even_rate(np.array([0.0]), "here")


def tdms(tmp_path, force=FORCE, unit="N", names=("Fx", "Fy", "Fz"), clock=True, **other):
    path = tmp_path / "FORCE.tdms"
    properties = {} if unit is None else {"unit_string": unit}
    if clock:
        properties |= {"wf_increment": 1.0 / 5000.0, "wf_start_offset": 0.25}
    channels = [
        nptdms.ChannelObject("cut", name, force[:, k], properties | other.get(name, {}))
        for k, name in enumerate(names)
    ]
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([*channels, nptdms.ChannelObject("cut", "speed", force[:, 0])])
    return path


def test_tdms(tmp_path):
    record, odd = read_force(tdms(tmp_path))
    np.testing.assert_array_equal(record.force, FORCE)
    assert (record.start, record.rate, odd) == (0.25, 5000.0, ())


def test_tdms_in_kilonewtons_named_in_brackets(tmp_path):
    names = ("Fx [kN]", "Fy [kN]", "Fz [kN]")
    record, _ = read_force(tdms(tmp_path, FORCE / 1e3, None, names))
    np.testing.assert_allclose(record.force, FORCE)


def test_tdms_with_a_channel_of_times(tmp_path):
    path = tmp_path / "FORCE.tdms"
    columns = {"t_s": T + 2.0, **{f"f{a}_N": FORCE[:, k] for k, a in enumerate("xyz")}}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("cut", n, v) for n, v in columns.items()])
    record, _ = read_force(path)
    np.testing.assert_array_equal(record.force, FORCE)
    assert record.rate == pytest.approx(5000.0)
    assert record.start == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("change", "error", "said"),
    [
        ({"unit": None}, FormatError, "is in no unit"),
        ({"unit": "V"}, FormatError, "is in V"),
        ({"clock": False}, FormatError, "has no clock"),
        ({"names": ("Fx", "Fy", "Mz")}, FormatError, "no channel fz"),
        ({"names": ("Fx", "fx", "Fz")}, FormatError, "two channels fx"),
        ({"force": spoil(7, 0, np.nan)}, FormatError, "sample 7 of 'Fx' is nan"),
        ({"Fy": {"wf_increment": 1e-3}}, ImplausibleDataError, "clocks differ"),
        ({"force": np.clip(FORCE, -20.0, 20.0)}, ImplausibleDataError, "saturated"),
    ],
)
def test_tdms_refused(tmp_path, change, error, said):
    with pytest.raises(error, match=said):
        read_force(tdms(tmp_path, **change))


def test_tdms_that_is_none(tmp_path, monkeypatch):
    import sys

    path = tmp_path / "a.tdms"
    path.write_text("t_s,fx_N\n")
    with pytest.raises(FormatError, match="cannot be read as TDMS"):
        read_force(path)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(MissingExtraError, match=r"robotrue\[dynamics\]"):
        read_force(path)


def test_mat(tmp_path):
    path = tmp_path / "FORCE.mat"
    variables = {f"f{axis}_N": FORCE[:, k] for k, axis in enumerate("xyz")}
    savemat(path, variables | {"rate_Hz": 5000.0})
    np.testing.assert_array_equal(read_force(path)[0].force, FORCE)
    savemat(path, variables | {"t_s": T})
    assert read_force(path)[0].rate == pytest.approx(5000.0)
    savemat(path, variables)
    with pytest.raises(FormatError, match="no variable t_s"):
        read_force(path)


def test_unknown_suffix(tmp_path):
    with pytest.raises(FormatError, match=r"suffix '\.wav'"):
        read_force(tmp_path / "a.wav")
