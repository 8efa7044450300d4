"""Runs inside the robotkinecal environment: calibration from points.

Usage: python heavy_arm_robotkinecal.py CASE.npz OUT.npz
"""

import contextlib
import io
import sys
import time

import numpy as np
import roboticstoolbox as rtb
from robotkinecal import SerialRobotKineCal

case = np.load(sys.argv[1])


def nominal():
    """The nominal arm as elementary transforms; every joint turns about its own z."""
    links, parent, et = [], None, rtb.ET
    for i in range(6):
        ets = et.Rx(case["alpha"][i]) * et.tx(case["a"][i]) * et.Rz(case["theta"][i])
        ets = ets * et.tz(case["d"][i]) * et.Rz()
        parent = rtb.Link(ets, name=f"link{i + 1}", parent=parent)
        links.append(parent)
    x, y, z = case["tool"]
    links.append(rtb.Link(et.tx(x) * et.ty(y) * et.tz(z), name="ee", parent=parent))
    return rtb.ERobot(links)


def points(cal, q):
    return np.array([cal.forward_kinematics(cal.N_JOINTS + 1, row).t for row in q])


wall, cpu = [], []
with contextlib.redirect_stdout(io.StringIO()):
    check = points(SerialRobotKineCal(nominal(), ee_name="ee"), case["joints"])
    if np.abs(check - case["nominal_calibration"]).max() > 1e-9:
        sys.exit("nominal kinematics differ from the case")
    for _ in range(int(case["repeats"])):
        cal = SerialRobotKineCal(nominal(), ee_name="ee")
        begin = time.perf_counter(), time.process_time()
        cal.set_observations(list(case["joints"]), list(case["measured"]))
        cal.solve()
        wall.append(time.perf_counter() - begin[0])
        cpu.append(time.process_time() - begin[1])
    out = points(cal, case["test"])
np.savez(sys.argv[2], position=out, wall=wall, cpu=cpu)
