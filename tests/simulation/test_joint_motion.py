"""A motion that is worked out many cycles at once is the motion."""

import numpy as np

from robotrue.core.rotations import abc_from_matrix, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.robot.presets import preset
from robotrue.simulation.cyclic_controller import Jog, MotionGrid


def test_a_motion_worked_out_ahead_is_the_motion():
    jog = Jog(robot=preset("kr160"), joints=np.radians([0.0, 30.0, -30.0, 0.0, 60.0, 0.0]))
    ahead = MotionGrid(jog, 4e-3)
    for number in (0, 1, 63, 64, 200, 90):  # on, past the end, over a gap, back
        place = ahead.at(number)
        (joints,), (pose,) = jog.along(np.array([number * 4e-3]))
        np.testing.assert_allclose(np.array(place.joints_deg) * DEG, joints, atol=1e-14)
        np.testing.assert_allclose(np.array(place.pose_mm_deg[:3]) * MM, pose[:3, 3], atol=1e-14)
        quat = quat_wxyz_from_matrix(pose[:3, :3])
        np.testing.assert_allclose(place.quat_wxyz, quat, atol=1e-14)
        abc = abc_from_matrix(pose[:3, :3])
        np.testing.assert_allclose(np.array(place.pose_mm_deg[3:]) * DEG, abc, atol=1e-12)
