"""Jin, Sun, Tang, Li 2022: Tables 1 to 3 and the text, four to five digits, against our code.

Table 2 holds eigenvalues and contributions, Table 3 four loadings of joints 1 to 6, peak and mean
force; the text K = 4, RMSE 2.53 (70 windows) and 3.75 (23).
"""

import numpy as np

from robotrue.core.units import DEG
from robotrue.dynamics.paper_learners import components_of, count_components
from robotrue.robot.forward import forward
from robotrue.robot.inverse import inverse_path
from robotrue.simulation.milling_arm import milling_robot, pass_joints
from robotrue_reproductions.jin2022.jin_tables import EIGENVALUES, ROWS_DEG, printed_figures
from robotrue_reproductions.jin2022.milling_pass import window_edges

CONTRIBUTIONS = np.array([68.10, 15.00, 11.84, 5.05])
LOADINGS = np.array(
    [
        [0.4241, 0.4272, -0.3669, 0.4181, 0.4111, -0.3860, 0.0998, 0.0167],
        [-0.0810, -0.0504, -0.2006, -0.1137, 0.0988, 0.2019, 0.7646, -0.5501],
        [-0.0883, -0.0492, -0.2855, -0.1344, 0.1460, 0.2641, 0.3846, 0.8070],
        [0.1072, 0.0299, 0.5907, 0.1924, -0.3418, -0.4260, 0.5075, 0.2139],
    ]
)
CORRELATION = (LOADINGS.T * EIGENVALUES[:4]) @ LOADINGS


def test_printed_tables_agree_with_each_other():
    assert abs(EIGENVALUES.sum() - 8.0) < 2e-4
    assert np.abs(LOADINGS @ LOADINGS.T - np.eye(4)).max() < 1e-4
    assert np.abs(np.diag(CORRELATION) - 1.0).max() < 2e-3
    assert np.abs(CONTRIBUTIONS - 100.0 * EIGENVALUES[:4] / 8.0).max() < 0.06


def test_loadings_alone_give_the_eigenvalues():
    """A correlation matrix has ones on its diagonal: sum_k w_kj^2 r_k = 1 for every column j."""
    value = np.linalg.lstsq((LOADINGS**2).T, np.ones(8), rcond=None)[0]
    np.testing.assert_allclose(value, [5.4486, 1.2000, 0.9472, 0.4041], atol=2e-3)


def test_rule_of_95_percent_keeps_four():
    assert count_components(EIGENVALUES) == 4
    assert CONTRIBUTIONS[:3].sum() < 95.0 < CONTRIBUTIONS.sum()


def test_joints_of_the_straight_pass_have_the_printed_correlations():
    edges = window_edges()
    joints = pass_joints(0.5 * (edges[1:] + edges[:-1]))
    assert np.abs(np.corrcoef(joints.T) - CORRELATION[:6, :6]).max() < 0.02


def test_components_of_the_straight_pass_have_the_printed_form():
    edges = window_edges()
    joints = pass_joints(0.5 * (edges[1:] + edges[:-1]))
    found = components_of(joints)
    block = np.linalg.eigvalsh(CORRELATION[:6, :6])[::-1]
    np.testing.assert_allclose(found.eigenvalues[:2], block[:2], atol=0.02)
    assert found.eigenvalues[2] < 1e-3
    np.testing.assert_allclose(found.loadings.T @ found.loadings, np.eye(6), atol=1e-12)


def test_inverse_on_the_mean_line_gives_the_printed_joints():
    robot = milling_robot()
    poses = forward(robot, ROWS_DEG * DEG)
    flange = poses @ np.linalg.inv(robot.T_flange_tool)
    left, _, right = np.linalg.svd(flange[:, :3, :3].mean(axis=0))
    line = np.tile(np.eye(4), (10, 1, 1))
    line[:, :3, :3] = left @ right  # the mean attitude
    line[:, 0, 3], line[:, 1:3, 3] = flange[:, 0, 3], flange[:, 1:3, 3].mean(axis=0)
    joints = inverse_path(robot, line @ robot.T_flange_tool, near=ROWS_DEG[0] * DEG)
    assert np.abs(joints / DEG - ROWS_DEG).max() < 0.003


def test_pooled_error_of_the_printed_split():
    figures = {f.name: f.median for f in printed_figures()}
    assert abs(figures["pooled RMSE of both parts"] - 2.880) < 5e-4
    assert figures["printed poses off a straight line"] < 0.02
    assert abs(figures["way of the ten rows"] - 44.04) < 0.01
