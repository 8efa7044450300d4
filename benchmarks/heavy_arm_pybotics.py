"""Runs inside the pybotics environment: 24 modified-DH numbers, tool and world, 3-vector residual.

Usage: python heavy_arm_pybotics.py CASE.npz OUT.npz
"""

import sys
import time

import numpy as np
from pybotics.geometry import position_from_matrix
from pybotics.kinematic_chain import MDHKinematicChain
from pybotics.optimization import OptimizationHandler
from pybotics.robot import Robot
from scipy.optimize import least_squares

case = np.load(sys.argv[1])
# pybotics adds the theta offsets of the table itself; millimetres, as it documents.
table = np.column_stack([case["alpha"], case["a"] * 1e3, case["theta"], case["d"] * 1e3])
robot = Robot(MDHKinematicChain.from_parameters(table.ravel()))
robot.joint_limits = np.tile([[-10.0], [10.0]], (1, 6))
robot.tool.position = case["tool"] * 1e3
handler = OptimizationHandler(
    robot,
    kinematic_chain_mask=[True] * 24,
    tool_mask=[True] * 3 + [False] * 3,
    world_mask=True,
)
joints, measured = case["joints"], case["measured"] * 1e3


def model(vector, q):
    handler.apply_optimization_vector(vector)
    return np.array([position_from_matrix(handler.robot.fk(row)) for row in q])


start = handler.generate_optimization_vector()
nominal = model(start, joints)
if np.linalg.norm(nominal - case["nominal_calibration"] * 1e3, axis=1).max() > 1e-6:
    raise SystemExit("nominal kinematics differ from the case")
wall, cpu = [], []
for _ in range(int(case["repeats"])):
    begin = time.perf_counter(), time.process_time()
    result = least_squares(lambda v: (model(v, joints) - measured).ravel(), start, x_scale="jac")
    wall.append(time.perf_counter() - begin[0])
    cpu.append(time.process_time() - begin[1])
np.savez(sys.argv[2], position=model(result.x, case["test"]) * 1e-3, wall=wall, cpu=cpu)
