"""Runs inside the figaroh environment: calibration from points by one of three routes.

    python heavy_arm_figaroh.py CASE.npz OUT.npz structural|non-geometric|by-hand

``structural`` is the documented default, ``non-geometric`` adds ``include_non_geometric: true`` to
the configuration as documented, ``by-hand`` puts the elastic parameters back that the naming of an
unknown base frame overwrites. The time is of ``solve()`` alone; ``initialize()``, which reads the
data and selects the parameters, is reported beside it.
"""

import contextlib
import io
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from figaroh.calibration.base_calibration import BaseCalibration
from figaroh.calibration.calibration_tools import calc_updated_fkm
from figaroh.tools.robot import load_robot

warnings.simplefilter("ignore")
case, route = np.load(sys.argv[1]), sys.argv[3]
holder = tempfile.TemporaryDirectory()
folder = Path(holder.name)
CONFIG = """
robot:
  name: heavy_arm
  properties:
    joints:
      active_joints: [joint_1, joint_2, joint_3, joint_4, joint_5, joint_6]
tasks:
  calibration:
    enabled: true
    parameters:
      calibration_level: full_params
      include_non_geometric: {elastic}
      outlier_threshold: 0.05
    kinematics:
      base_frame: universe
      tool_frame: tool0
    measurements:
      markers:
        - name: reflector
          reference_joint: joint_6
          measurable_dof: [true, true, true, false, false, false]
      poses:
        base_pose: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        tool_pose: [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    data:
      source_file: {data}
      number_of_samples: {count}
"""


class Calibration(BaseCalibration):
    """The subclass the documentation asks for: unknown base and tip, residual of the points."""

    def __init__(self, robot, config_file):
        super().__init__(robot, config_file)
        self.calib_config["known_baseframe"] = False
        self.calib_config["known_tipframe"] = False

    def cost_function(self, var):
        """Residuals of the points, in the world frame."""
        told = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.apply_measurement_weighting(
            self._compute_logmap_residuals(self.PEE_measured, told, position_frame="world"),
            pos_weight=1.0,
            orient_weight=1.0,
        )


def predicted(calibration, var, q):
    """Points (n, 3) m at joints (n, 6)."""
    told = {**calibration.calib_config, "NbSample": len(q)}
    flat = calc_updated_fkm(calibration.model, calibration.data, var, q, told)
    return flat.reshape(3, len(q)).T


def fresh(robot, config):
    out = Calibration(robot, str(config))
    elastic = list(out.calib_config["param_name"])
    begin = time.perf_counter()
    out.initialize()
    if route == "by-hand":
        names = out.calib_config["param_name"]
        names += [name for name in elastic if name not in names]
    return out, time.perf_counter() - begin


urdf, table, config = folder / "arm.urdf", folder / "points.csv", folder / "config.yaml"
urdf.write_text(str(case["urdf"]))
head = "x1,y1,z1," + ",".join(f"joint_{i + 1}" for i in range(6))
np.savetxt(
    table,
    np.hstack([case["measured"], case["joints"]]),
    delimiter=",",
    header=head,
    comments="",
    fmt="%.17g",
)
config.write_text(
    CONFIG.format(
        elastic="false" if route == "structural" else "true", data=table, count=len(case["joints"])
    )
)
prepare, wall, cpu = [], [], []
with contextlib.redirect_stdout(io.StringIO()):
    robot = load_robot(str(urdf), package_dirs=str(folder))
    for _ in range(int(case["repeats"])):
        calibration, took = fresh(robot, config)
        prepare.append(took)
        zero = np.zeros(len(calibration.calib_config["param_name"]))
        check = predicted(calibration, zero, case["joints"])
        if np.abs(check - case["nominal_calibration"]).max() > 1e-9:
            sys.exit("nominal kinematics differ from the case")
        begin = time.perf_counter(), time.process_time()
        result = calibration.solve(enable_logging=False)
        wall.append(time.perf_counter() - begin[0])
        cpu.append(time.process_time() - begin[1])
    out = predicted(calibration, result.x, case["test"])
names = calibration.calib_config["param_name"]
elastic = [name for name in names if name.startswith("k_")]
note = (
    f"{calibration.STATUS}, {len(names)} parameters, {len(elastic)} of them elastic; "
    f"initialize() {min(prepare):.2f} s more"
)
if elastic:
    first = result.x[names.index(elastic[0])]
    note += f"; {elastic[0]} = {first:.3g} rad/(N m)"
np.savez(sys.argv[2], position=out, wall=wall, cpu=cpu, note=note)
