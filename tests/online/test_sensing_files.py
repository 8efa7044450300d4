"""The estimator of ``robotrue sense`` from files: each optional, its lack said."""

import numpy as np
import pytest

from robotrue.core.archive import write_archive
from robotrue.core.units import DEG
from robotrue.dynamics.flange_sensor import HeldTool
from robotrue.errors import ArchiveError, ConfigurationError, ModelMismatchError
from robotrue.online.sensing_files import SensingFiles, sensing_of

CELL = """\
schema = 1

[robot]
preset = "ABB IRB 6660-205/1.9"
stiffness_Nm_per_rad = [1.3e6, 2.0e6, 1.7e6, 2.4e5, 1.8e5, 1.7e5]

[tool]
xyz_mm = [320, 0, 160]
abc_deg = [0, 0, 0]
"""


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(CELL)
    return path


def test_stated_stiffness_alone_is_enough_and_says_what_it_leaves_out(cell):
    sensing, remarks = sensing_of(SensingFiles(cell=cell), 5000.0)
    assert sensing.models.response is None
    np.testing.assert_allclose(sensing.models.compliance.compliance[0], 1.0 / 1.3e6)
    said = " ".join(remarks)
    for word in (
        "vibration is not included",
        "no tool stated",
        "as stated in the cell",
        "settling for",
    ):
        assert word in said


def test_held_tool_and_place_of_the_sensor(cell, tmp_path):
    three = np.ones(3)
    tool = HeldTool(
        mass=18.5, centre=0.1 * three, weight_in_base=np.array([0.0, 0.0, -181.0]),
        force_offset=three, moment_offset=three, mass_sd=0.02, centre_sd=1e-4 * three,
        force_offset_sd=0.2 * three, condition=2.2, force_noise=0.4, moment_noise=0.03,
    )  # fmt: skip
    path = tmp_path / "tool.robotrue"
    write_archive(path, tool.to_archive(source="poses.csv"))
    files = SensingFiles(cell=cell, tool=path, sensor="0,0,25,90,0,0")
    sensing, remarks = sensing_of(files, 5000.0)
    assert sensing.models.held.mass == 18.5
    np.testing.assert_allclose(sensing.models.T_flange_sensor[:3, 3], [0.0, 0.0, 0.025])
    assert "18.50 kg are on the sensor" in " ".join(remarks)
    with pytest.raises(ArchiveError, match="expected 'dynamic-deviation'"):
        sensing_of(SensingFiles(cell=cell, deviation=path, spindle_rpm=3600.0), 5000.0)


def test_options_that_need_another(cell, tmp_path):
    frf = tmp_path / "frf.csv"
    for changes, words in (
        ({"frf": frf}, "the pose it was measured at"),
        ({"frf_frame": "tool"}, "state where --frf was measured"),
        ({"frf": frf, "frf_joints": "0,0,0,0,0,0", "frf_frame": "world"}, "expected base or tool"),
        ({"deviation": frf}, "needs the speed of the spindle"),
        ({"sensor": "1,2,3"}, "expected 6 numbers"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            sensing_of(SensingFiles(cell=cell, **changes), 5000.0)


def test_nothing_that_bends_is_refused(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(CELL.replace("stiffness", "# stiffness"))
    with pytest.raises(ConfigurationError, match="neither stiffness nor frequency response"):
        sensing_of(SensingFiles(cell=path), 5000.0)


def frf_csv(path, times=1.0):
    """One mode of the arm and one of the tool along y, as a hammer test gives them."""
    f = np.arange(2.0, 400.0, 0.5)
    g = np.zeros(len(f), dtype=complex)
    for hz, damping, stiffness in ((9.0, 0.04, 5e5), (150.0, 0.05, 1e7)):
        g += 1.0 / stiffness / (1.0 - (f / hz) ** 2 + 2j * damping * f / hz)
    rows = "\n".join(
        f"{a:.2f},{b.real:.9e},{b.imag:.9e}" for a, b in zip(f, g * times, strict=True)
    )
    path.write_text("f_Hz,Gyy_re_m_per_N,Gyy_im_m_per_N\n" + rows + "\n")
    return path


def test_response_with_its_pose_and_frame(cell, tmp_path):
    joints = "-26,-12,52,-32,-57,19"
    files = SensingFiles(
        cell=cell, frf=frf_csv(tmp_path / "frf.csv"), frf_joints=joints,
        frf_frame="base",
    )  # fmt: skip
    sensing, remarks = sensing_of(files, 5000.0)
    response = sensing.models.response
    np.testing.assert_allclose(response.oscillators.static[1, 1], 2.1e-6, rtol=0.02)
    shown = sensing.models.robot.controller.to_controller(response.joints) / DEG
    np.testing.assert_allclose(shown, [-26, -12, 52, -32, -57, 19])
    assert "has no data along x" in " ".join(remarks)


def test_response_of_another_unit_is_refused(cell, tmp_path):
    files = SensingFiles(
        cell=cell, frf=frf_csv(tmp_path / "frf.csv", 100.0),
        frf_joints="-26,-12,52,-32,-57,19", frf_frame="base",
    )  # fmt: skip
    with pytest.raises(ModelMismatchError, match="a receptance in m/N"):
        sensing_of(files, 5000.0)
