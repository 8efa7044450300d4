"""Time histories of universal files: units, directions and clocks, and what they refuse."""

import struct
import sys

import numpy as np
import pytest
from pass_cases import uff_set

from robotrue.dynamics.formats.signal_table import read_force, read_signals
from robotrue.errors import FormatError, ImplausibleDataError, MissingExtraError

pytest.importorskip("pyuff")

N, STEP = 400, 1.0 / 5120.0
RNG = np.random.default_rng(5)
TIME = np.arange(N) * STEP
FORCE = 40.0 * np.sin(2 * np.pi * 60.0 * TIME)[:, None] * [1.0, -0.5, 0.2] + RNG.normal(size=(N, 3))
LASER = 1e-3 * RNG.normal(size=N)


def file_of(tmp_path, *sets):
    path = tmp_path / "record.uff"
    path.write_bytes(b"".join(one if isinstance(one, bytes) else one.encode() for one in sets))
    return path


def forces(start=0.0, step=STEP, **changes):
    names = ("fx_N", "fy_N", "fz_N")
    return [
        uff_set(name, column, start, step, **changes)
        for name, column in zip(names, FORCE.T, strict=True)
    ]


def test_directions_and_units_of_a_force(tmp_path):
    x, _, z = forces(start=1.5)
    turned = uff_set("side", -1e-3 * FORCE[:, 1], 1.5, STEP, kind=9, direction=-2, unit="kN")
    record, _ = read_force(file_of(tmp_path, z, x, turned))
    np.testing.assert_allclose(record.force, FORCE, rtol=1e-11, atol=1e-11)
    assert record.start == 1.5
    assert record.rate == pytest.approx(5120.0, rel=1e-12)


def test_units_of_the_file_stand_in_for_labels(tmp_path):
    """Dataset 164 of millimetres and kilonewtons: SI over file."""
    units = "    -1\n   164\n" + f"{5:10d}{'mm':20s}{2:10d}\n"
    units += "".join(f"{v:25.17E}" for v in (1e3, 1e-3, 1.0)).replace("E", "D") + "\n"
    units += f"{273.15:25.17E}\n".replace("E", "D") + "    -1\n"
    record, _ = read_force(file_of(tmp_path, units, *forces(unit="NONE")))
    np.testing.assert_allclose(record.force, 1e3 * FORCE, rtol=1e-11)
    moved = uff_set("Keyence", LASER, 0.0, STEP, kind=8, direction=2, unit="NONE")
    signals = read_signals(file_of(tmp_path, units, moved), [["d_um"], ["d_mm"]])
    np.testing.assert_allclose(signals.values[:, 0], 1e3 * LASER, rtol=1e-11)


def test_a_rate_that_the_header_rounds(tmp_path):
    """1/51200 s is printed as 1.95312E-05: 0.26 ms off after 100 s, were it believed."""
    record, _ = read_force(file_of(tmp_path, *forces(step=1.0 / 51200.0)))
    assert record.rate == pytest.approx(51200.0, rel=1e-12)
    record, _ = read_force(file_of(tmp_path, *forces(step=1.2345e-4)))
    assert record.rate == pytest.approx(1.0 / 1.2345e-4, rel=1e-12)


def test_joints_by_name_and_label_on_a_clock_of_their_own(tmp_path):
    joints = RNG.uniform(-60.0, 60.0, (N, 6))
    clock = np.cumsum(RNG.uniform(0.003, 0.005, N)).round(4)
    sets = [
        uff_set(f"j{k + 1}", column, 0.0, 0.004, unit="deg", uneven=clock)
        for k, column in enumerate(joints.T)
    ]
    names = [f"j{k}_deg" for k in range(1, 7)]
    signals = read_signals(file_of(tmp_path, *sets, *forces()), [names])
    np.testing.assert_allclose(signals.values, joints, rtol=1e-11)
    np.testing.assert_allclose(signals.time, clock, rtol=1e-12)
    late = uff_set("j6", joints[:, 5], 0.1, 0.004, unit="deg")
    with pytest.raises(ImplausibleDataError, match=r"set 6 \(j6\) has another clock than set 1"):
        read_signals(file_of(tmp_path, *sets[:5], late), [names])


def test_binary_sets(tmp_path):
    sets = []
    for one, column in zip(forces(), FORCE.T, strict=True):
        head = one.encode().split(b"\n")[:13]
        head[1] = b"    58b     1     2          11" + f"{8 * N:12d}".encode() + b" " * 48
        body = struct.pack(f"<{N}d", *column)
        sets.append(b"\n".join([*head, body + b"\n    -1\n"]))
    record, _ = read_force(file_of(tmp_path, *sets))
    np.testing.assert_array_equal(record.force, FORCE)


def test_refused(tmp_path):
    def refused(said, *sets, error=FormatError):
        with pytest.raises(error, match=said):
            read_force(file_of(tmp_path, *sets))

    x, y, z = forces()
    refused("no channel fz", x, y)
    refused("set 4 is 'x', as set 1 is", x, y, z, x)
    refused("set 1 has no unit: label 'V'", *forces(unit="V"))
    refused("set 1: direction 4 of the response", *forces(direction=4))
    refused("no force over time in it", *forces(kind=12))
    refused(r"set 1 \(channel 1\) is over 'ms', expected s",
            *(one.replace(f" {'s':20s}", f" {'ms':20s}", 1) for one in (x, y, z)))  # fmt: skip
    spectrum = x.replace(f"{17:10d}", f"{18:10d}", 1)
    refused("no time history in it", spectrum)
    refused(f"has {N} samples, its header says {N + 1}",
            x.replace(f"{4:10d}{N:10d}", f"{4:10d}{N + 1:10d}"), y, z)  # fmt: skip
    refused("another clock", x, y, uff_set("fz_N", FORCE[:, 2], 0.5, STEP),
            error=ImplausibleDataError)  # fmt: skip
    two = [uff_set(n, LASER, 0.0, STEP, kind=8, unit="mm") for n in ("left", "right")]
    path = file_of(tmp_path, *two)
    with pytest.raises(FormatError, match="expected t_s and d_um or d_mm"):
        read_signals(path, [["d_um"], ["d_mm"]])


def test_without_pyuff(tmp_path, monkeypatch):
    path = file_of(tmp_path, *forces())
    monkeypatch.setitem(sys.modules, "pyuff", None)
    with pytest.raises(MissingExtraError, match="universal files need pyuff"):
        read_force(path)
