"""ABB IRB 6660-205/1.9: joints printed for ten windows of a straight machining pass (3 decimals).

The pass runs along base X at a fixed spindle axis. It does so only with the parallel rod and only
for this variant: that is how robot and convention were identified.
"""

from dataclasses import replace

import numpy as np

from robotrue.core.rotations import rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_path
from robotrue.robot.presets import preset

ROWS_DEG = np.array(
    [
        [-26.174, -12.054, 52.467, -32.046, -56.636, 18.89],
        [-25.999, -11.49, 52.572, -31.812, -56.668, 18.716],
        [-25.85, -11.006, 52.66, -31.613, -56.695, 18.569],
        [-25.739, -10.647, 52.722, -31.466, -56.712, 18.462],
        [-25.618, -10.25, 52.788, -31.305, -56.73, 18.346],
        [-25.479, -9.799, 52.861, -31.124, -56.748, 18.216],
        [-25.364, -9.422, 52.919, -30.974, -56.762, 18.11],
        [-25.249, -9.043, 52.975, -30.824, -56.774, 18.004],
        [-25.133, -8.66, 53.03, -30.674, -56.785, 17.9],
        [-25.014, -8.265, 53.084, -30.521, -56.795, 17.794],
    ]
)


def _off_chord_mm(points):
    chord = points[-1] - points[0]
    chord = chord / np.linalg.norm(chord)
    offset = points - points[0]
    return np.linalg.norm(offset - (offset @ chord)[:, None] * chord, axis=1).max() / MM


def test_first_and_last_row():
    points = forward(preset("irb6660"), ROWS_DEG * DEG)[:, :3, 3]
    np.testing.assert_allclose(points[0], [1.025560, -0.405303, 0.960529], atol=1e-6)
    np.testing.assert_allclose(points[-1], [1.069603, -0.405300, 0.960459], atol=1e-6)


def test_pass_is_straight_only_with_the_rod():
    robot = preset("irb6660")
    with_rod = forward(robot, ROWS_DEG * DEG)
    serial = forward(replace(robot, joint_map=np.eye(6)), ROWS_DEG * DEG)
    assert _off_chord_mm(with_rod[:, :3, 3]) < 0.02
    assert _off_chord_mm(serial[:, :3, 3]) > 0.3
    turn = rotation_vector_from_matrix(with_rod[:, :3, :3] @ with_rod[0, :3, :3].T)
    assert np.linalg.norm(turn, axis=1).max() < 0.006 * DEG


def test_inverse_along_the_fitted_line_gives_the_printed_joints():
    robot = preset("irb6660")
    printed = ROWS_DEG * DEG
    poses = forward(robot, printed)
    line = poses[[0]].repeat(10, axis=0)
    line[:, :3, 3] = [0.0, -0.40530, 0.960494]
    line[:, 0, 3] = poses[:, 0, 3]
    mean = rotation_vector_from_matrix(poses[:, :3, :3] @ poses[0, :3, :3].T).mean(axis=0)
    assert np.linalg.norm(mean) < 0.006 * DEG
    joints = inverse_path(robot, line, near=printed[0])
    assert np.abs(joints - printed).max() < 0.006 * DEG
