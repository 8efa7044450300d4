"""``register``: the part's frame from touches, checked and tied to a model of the arm.

Touches in joints are taken through the model that is given: a calibrated one or the nominal arm.
Where there are enough of them arm, tool and frames are estimated together; else the model stays as
it is and the frame alone is fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel, identity_of, provenance_of
from robotrue.cell.registration.fit import Noise
from robotrue.core.provenance import merge
from robotrue.core.surfaces import TriangleMesh
from robotrue.errors import ModelMismatchError, ShapeError
from robotrue.measurement.formats.part_points import ONE_PART
from robotrue.measurement.probing_set import NO_SURFACE, ProbingSet
from robotrue.validation.registered_part import FoundFrame, RegisteredPart
from robotrue.validation.registration_frame import (
    GOOD,
    CheckedTouches,
    RegistrationSettings,
    frame_alone,
    robot_share,
    tips,
)
from robotrue.validation.registration_joint import (
    enough_for_joint,
    joint_registration,
    require_numbers,
)
from robotrue.validation.touch_checks import (
    check_mirror,
    check_on_mesh,
    check_order,
    check_pattern_of,
    check_units,
    file_of,
    naming,
)
from robotrue.validation.validation_defaults import REGISTRATION_METHOD

__all__ = ["RegisteredPart", "RegistrationSettings", "register"]

NOMINAL_COST: Final = (
    "The frame was computed with the nominal arm. In 100 simulated cells such a frame "
    "machined to 0.16 to 0.20 mm rms on the side and in the postures of its touches, to 1.4 mm "
    "on another side, and to 0.7 mm where touches of three sides share it; with nine or more "
    "touches of three sides the arm is estimated as well, and 0.1 to 0.2 mm are left on each "
    "side. Probe each side separately (column part), probe more points, or calibrate."
)
"""What a plain frame of a nominal arm costs."""


def register(
    arm: ErrorModel,
    touches: ProbingSet,
    *,
    parts: Sequence[str] = ONE_PART,
    settings: RegistrationSettings | None = None,
) -> RegisteredPart:
    """Returns the frames of the parts, with covariance, verdict and the model they belong to.

    Args:
        arm: The model used for touching and machining; :class:`NominalModel` without one.
        touches: Of one part or several; their ``part`` counts ``parts``.
        parts: Names.
        settings: Noise, tool, tolerance, mesh.

    Raises:
        ObservabilityError: Collinear or coincident points, too few touches, an undetermined motion.
        ImplausibleDataError: Wrong units, exchanged names, a mirrored part, points off the part,
            half of the touches contradicting the others.
        ModelMismatchError: Joints of another robot.
        ConvergenceError: A fit that does not converge.

    Fails when: touches of a flat pattern belong to the mirrored part: they fit it upside down.
    """
    settings = RegistrationSettings() if settings is None else settings
    check_rows(arm, touches, parts)
    if settings.fit == "joint":
        require_numbers(touches)
    several = len(parts) > 1
    checked = []
    for k, name in enumerate(parts):
        mine = touches.subset(touches.part == k)
        with naming(mine, name if several else ""):
            checked.append(check_touches(arm, name, mine, settings))
    joint = settings.fit == "joint" or (
        settings.fit == "auto"
        and settings.method == REGISTRATION_METHOD
        and enough_for_joint(arm, touches, settings)
    )
    if joint:
        whole = touches if settings.mesh is None else _on_mesh(touches, settings.mesh)
        with naming(touches):
            return joint_registration(arm, checked, whole, settings)
    identity = identity_of(arm)
    nominal = not arm.calibrated and touches.has_joints
    return RegisteredPart(
        route="frame",
        frames=tuple(_alone(arm, found, settings, several) for found in checked),
        identity=identity,
        touched_with=identity,
        doubts=(NOMINAL_COST,) if nominal else (),
        provenance=merge([touches.provenance, *([provenance_of(arm)] if arm.calibrated else [])]),
    )


def _alone(
    arm: ErrorModel,
    found: CheckedTouches,
    settings: RegistrationSettings,
    several: bool,
) -> FoundFrame:
    with naming(found.touches, found.name if several else ""):
        return frame_alone(arm, found, settings)


def check_rows(arm: ErrorModel, touches: ProbingSet, parts: Sequence[str]) -> None:
    """Passes if touches are of this arm and of the parts named.

    Raises:
        ModelMismatchError: Joints of another robot.
        ShapeError: Another number of parts.
    """
    robot = arm.robot
    if touches.has_joints and touches.joints.shape[1] != robot.dof:
        raise ModelMismatchError(
            f"{touches.joints.shape[1]} joint columns, {robot.name} has {robot.dof} joints.",
            source=file_of(touches),
            hint="one column j1_deg, j2_deg, ... per joint.",
        )
    if touches.parts != tuple(range(len(parts))):
        raise ShapeError(f"touches of parts {touches.parts}, names for {len(parts)}: {parts}.")


def check_touches(
    arm: ErrorModel, name: str, touches: ProbingSet, settings: RegistrationSettings
) -> CheckedTouches:
    """Returns the touches of one part where a model has the tip, with what cannot be ruled out.

    Raises:
        ObservabilityError: Collinear or coincident points.
        ImplausibleDataError: Wrong units, exchanged names, a mirrored part, points off the mesh.
    """
    in_base = touches.position
    if touches.has_joints:
        in_base = tips(arm, touches.joints, settings)
    check_pattern_of(touches)
    check_units(touches, in_base, lambda joints: tips(arm, joints, settings))
    doubts: tuple[str, ...] = ()
    if settings.mesh is not None:
        doubts += check_on_mesh(touches, settings.mesh, tolerance=settings.on_mesh)
        touches = _on_mesh(touches, settings.mesh)
    noise = Noise(touch=settings.touch, robot=robot_share(arm, touches, settings))
    doubts += check_mirror(touches, in_base, sigma=noise.sigma)
    doubts += check_order(touches, in_base, tolerance=GOOD * noise.sigma)
    return CheckedTouches(name=name, touches=touches, in_base=in_base, noise=noise, doubts=doubts)


def _on_mesh(touches: ProbingSet, mesh: TriangleMesh) -> ProbingSet:
    """The touches with a normal as touches of the mesh: it may be curved between them."""
    return replace(
        touches,
        surfaces=(mesh,),
        touched=np.where(touches.full, NO_SURFACE, 0),
        normal=np.full_like(touches.normal, np.nan),
    )
