"""Joints pasted on the probing page count as the controller counts them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from robotrue.app.workbench.probing_entry import reading_values
from robotrue.core.units import DEG
from robotrue.robot.presets import preset


@pytest.mark.parametrize("name", ["kr160", "r2000ic-165f"])
def test_axes_of_the_pendant_become_joints_of_the_model(name: str) -> None:
    robot = preset(name)
    joints = np.array([[10.0, -20.0, 30.0, 5.0, -15.0, 60.0]])
    axes = robot.controller.to_controller(joints * DEG)[0] / DEG
    session = SimpleNamespace(
        joints=True,
        cell=SimpleNamespace(robot=robot),
        session=SimpleNamespace(settings={"axes": "controller"}),
    )
    text = ", ".join(f"{axis:.9f}" for axis in axes)
    np.testing.assert_allclose(reading_values(session, text), joints[0], atol=1e-6)
