"""Calibration as parameters of the controller: joint zeros, tool and base.

Lengths and angles of links, gears, compliance and all that is learned stay outside. So the numbers
are not simply copied: zeros, tool and base are fitted to the whole model over the training range::

    min over (dtheta, base, tool) of sum |p_model(q) - p_rigid(q)|^2 + lever^2 |turn|^2

with the smallest change where several do alike (joint 1 and the base, the last joint and the tool).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypedDict

import numpy as np

from robotrue.calibration.terms.term_registry import export_parts
from robotrue.core.arrays import Array, IntArray
from robotrue.core.provenance import MARK, simulation_mark
from robotrue.core.rotations import (
    abc_from_matrix,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConvergenceError
from robotrue.report.export_losses import (
    ExportableModel,
    Loss,
    LossDocument,
    loss_document,
    losses,
    measure_loss,
    require_named,
)
from robotrue.robot.chain import error_pose
from robotrue.robot.forward import forward, parameter_jacobian, walk
from robotrue.robot.model import RobotModel, parameter_slice

CANNOT: Final = tuple(export_parts())
LEVER: Final = 0.25
"""m; a turn of the tool counts as much as the offset it makes at this distance."""
STEPS: Final = 20
SETTLED: Final = 1e-12
"""m and rad, largest step of the last round."""
SMALLEST: Final = 1e-7
"""Relative singular value below which a direction is not fitted but left at zero."""
WHERE: Final[Mapping[str, Mapping[str, str]]] = {
    "kuka": {
        "joint zeros": "mastering: correct the zero of each axis by the offset",
        "tool": "TOOL_DATA",
        "base": "$ROBROOT, or BASE_DATA of every base in use",
    },
    "abb": {
        "joint zeros": "motor calibration: Cal Offset of each axis",
        "tool": "tooldata, tframe",
        "base": "base frame of the mechanical unit, or wobjdata of every work object in use",
    },
    "ur": {
        "joint zeros": "joint calibration; not accessible to users in all versions",
        "tool": "TCP of the installation",
        "base": "no parameter: move the feature (plane) programs refer to",
    },
    "generic": {
        "joint zeros": "zero offset of each axis",
        "tool": "tool frame",
        "base": "base frame",
    },
}
"""Where a maker's controller keeps them."""


class FrameRow(TypedDict):
    """A frame as a controller prints it."""

    xyz_mm: list[float]
    abc_deg: list[float]


class ControllerSheet(LossDocument):
    """The JSON values of a controller sheet; ``where`` names the controller's own tables."""

    format: str
    format_version: int
    robot: str
    simulated: bool
    maker: str
    model_sha256: str
    joint_zero_offset_deg: dict[str, float]
    joint_zero_meaning: str
    tool: FrameRow
    tool_meaning: str
    base: FrameRow
    base_meaning: str
    where: dict[str, str]
    cannot_take: list[str]
    nominal_misses_rms_mm: float
    nominal_misses_largest_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerExport:
    """The sheet.

    Attributes:
        robot: The rigid arm with the fitted zeros, base and tool.
        before: What the nominal arm misses of the model.
        total: What the fitted one misses.
        lost: Each part that is left out, alone.
        document: The sheet as JSON values.
    """

    robot: RobotModel
    before: Loss
    total: Loss
    lost: tuple[Loss, ...]
    document: ControllerSheet

    def text(self) -> str:
        """Returns the sheet to read."""
        return _text(self.document)

    def json(self) -> str:
        """Returns the sheet as JSON."""
        return json.dumps(self.document, indent=1, allow_nan=False) + "\n"


def export_controller(found: ExportableModel, *, lossy: Sequence[str] = ()) -> ControllerExport:
    """Returns the sheet.

    Args:
        found: From :func:`robotrue.report.export_losses.prepare_export`.
        lossy: Parts the sheet may leave out.

    Raises:
        ConfigurationError: Parts that would be lost and are not named.
        ConvergenceError: The fit did not settle.
    """
    require_named(found, CANNOT, lossy)
    nominal = found.tables.robot.nominal()
    robot = fit_controller(found)
    lost = losses(found, found.held)
    before, total = measure_loss(found, nominal), measure_loss(found, robot)
    return ControllerExport(
        robot=robot,
        before=before,
        total=total,
        lost=lost,
        document=_document(robot, found, lost, before, total),
    )


def fit_controller(found: ExportableModel) -> RobotModel:
    """Returns the rigid arm whose zeros, base and tool come nearest to the model.

    Raises:
        ConvergenceError: Gauss-Newton did not settle.
    """
    robot = found.tables.robot.nominal()
    known = bool(np.isfinite(found.turn).all())
    aim = (
        matrix_from_rotation_vector(np.nan_to_num(found.turn))
        @ forward(robot, found.joints)[:, :3, :3]
    )
    place = _free(robot.dof)
    errors = np.zeros(len(robot.errors))
    for _ in range(STEPS):
        at = robot.with_errors(errors)
        state = walk(at, found.joints)
        jacobian = parameter_jacobian(at, state, found.joints)[:, :, place]
        off = np.zeros((len(found.joints), 6))
        off[:, :3] = found.position - state.position
        off[:, 3:] = rotation_vector_from_matrix(aim @ np.swapaxes(state.rotation, 1, 2))
        weight = np.repeat([1.0, LEVER if known else 0.0], 3)
        rows = (jacobian * weight[:, None]).reshape(-1, len(place))
        step = np.linalg.lstsq(rows, (off * weight).ravel(), rcond=SMALLEST)[0]
        errors[place] += step
        if np.abs(step).max() < SETTLED:
            return robot.with_errors(errors)
    raise ConvergenceError(f"zeros, base and tool did not settle in {STEPS} steps.")


def _free(dof: int) -> IntArray:
    groups = [parameter_slice(dof, g) for g in ("theta", "base", "tool")]
    return np.concatenate([np.arange(g.start, g.stop) for g in groups])


def _document(
    robot: RobotModel, found: ExportableModel, lost: Sequence[Loss], before: Loss, total: Loss
) -> ControllerSheet:
    sign = robot.controller.sign
    offset = sign * np.linalg.solve(robot.joint_map, robot.error("theta"))
    maker = robot.maker if robot.maker in WHERE else "generic"
    return {
        "format": "robotrue-controller-sheet",
        "format_version": 1,
        "robot": robot.name,
        "simulated": found.provenance.simulated,
        "maker": robot.maker,
        "model_sha256": found.digest,
        "joint_zero_offset_deg": {f"A{i + 1}": float(v) / DEG for i, v in enumerate(offset)},
        "joint_zero_meaning": "true angle minus displayed angle, in the controller's sense",
        "tool": _frame(robot.T_flange_tool @ error_pose(robot.error("tool"))),
        "tool_meaning": "flange to the measured point, X Y Z and A B C (Rz Ry Rx)",
        "base": _frame(error_pose(robot.error("base"))),
        "base_meaning": "true place of the arm's root in the assumed base",
        "where": dict(WHERE[maker]),
        "cannot_take": [x.name for x in lost],
        "nominal_misses_rms_mm": before.rms / MM,
        "nominal_misses_largest_mm": before.largest / MM,
        **loss_document(lost, total),
    }


def _frame(T: Array) -> FrameRow:
    return {
        "xyz_mm": (T[:3, 3] / MM).tolist(),
        "abc_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
    }


def _text(d: ControllerSheet) -> str:
    lines = [
        simulation_mark(d["simulated"], f"{MARK}: ")
        + f"Controller sheet, {d['robot']}, calibrated by robotrue",
        f"Model sha256 {d['model_sha256']}",
        "",
        f"Joint zeros ({d['joint_zero_meaning']}), deg; {d['where']['joint zeros']}",
        *(f"  {name}  {value:+.5f}" for name, value in d["joint_zero_offset_deg"].items()),
    ]
    for title, frame, meaning, where in (
        ("Tool", d["tool"], d["tool_meaning"], d["where"]["tool"]),
        ("Base", d["base"], d["base_meaning"], d["where"]["base"]),
    ):
        lines += [
            "",
            f"{title} ({meaning}); {where}",
            "  X {:.4f} mm  Y {:.4f} mm  Z {:.4f} mm".format(*frame["xyz_mm"]),
            "  A {:.5f} deg  B {:.5f} deg  C {:.5f} deg".format(*frame["abc_deg"]),
        ]
    lines += [
        "",
        f"Misses the model by {d['together_rms_mm']:.4f} mm rms, "
        f"{d['together_largest_mm']:.4f} mm at most, over poses spread over the training range;",
        f"with the nominal parameters {d['nominal_misses_rms_mm']:.4f} mm rms, "
        f"{d['nominal_misses_largest_mm']:.4f} mm at most.",
        "Left out, each part alone (before the fit of zeros, tool and base):",
        *(
            f"  {x['part']}: {x['rms_mm']:.4f} mm rms, {x['largest_mm']:.4f} mm at most"
            for x in d["left_out"]
        ),
        "Programs compensated by robotrue are for the unchanged controller: do not use both.",
    ]
    return "\n".join(lines) + "\n"
