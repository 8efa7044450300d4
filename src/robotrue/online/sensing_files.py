"""The estimator of the sensing service, from files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, cast

import numpy as np

from robotrue.calibration.model import ErrorModel, provenance_of
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.core.archive import read_archive
from robotrue.core.arrays import Array, parse_number_list
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.dynamics.deviation_file import read_learned_deviation
from robotrue.dynamics.flange_sensor import HeldTool, held_tool_from_archive
from robotrue.dynamics.formats.frf_table import read_frf
from robotrue.dynamics.frf_checks import check_response, response_remarks
from robotrue.dynamics.interpolation import rebuild_error
from robotrue.dynamics.modal_fit import fit_modes
from robotrue.dynamics.oscillators import oscillators_of
from robotrue.errors import ConfigurationError, ModelMismatchError
from robotrue.online.sensing import Sensing
from robotrue.online.sensing_models import (
    Axes,
    JointCompliance,
    LearnedPart,
    MeasuredResponse,
    SensingModels,
    SensingSettings,
)
from robotrue.robot.model import parameter_slice

STATED_SD: Final = 0.25
"""Standard deviation of a stated stiffness, part of it: what data sheets are off by."""
LEAST_MISFIT: Final = 0.05
"""Part of a response that no hammer test knows better, from one test to the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensingFiles:
    """Files and numbers that describe the arm, its tool and its sensor.

    Attributes:
        cell: cell.toml.
        model: Of ``robotrue calibrate``, for the stiffness of the joints.
        frf: Frequency response of the tool.
        frf_joints: Joints of the hammer test as the controller displays them, "A1,..,A6" in deg.
        frf_frame: Axes it was measured along: "base" or "tool".
        tool: Archive of ``robotrue dynamics sensor``.
        sensor: Where the force sensor sits on the flange, "X,Y,Z,A,B,C" in mm and deg.
        deviation: Archive of ``robotrue dynamics fit``.
        spindle_rpm: Turns of the spindle per minute; the deviation needs them.
        force_most: N, range of the sensor.
        calibrated: The model in ``model``.
    """

    cell: Path
    model: Path | None = None
    frf: Path | None = None
    frf_joints: str | None = None
    frf_frame: str | None = None
    tool: Path | None = None
    sensor: str | None = None
    deviation: Path | None = None
    spindle_rpm: float | None = None
    force_most: float | None = None
    calibrated: ErrorModel | None = None


def sensing_of(files: SensingFiles, rate: float) -> tuple[Sensing, tuple[str, ...]]:
    """Returns the estimator for so many force samples a second, and what to know of it.

    Raises:
        ConfigurationError: An option that needs another, or neither stiffness nor response.
        ModelMismatchError: Files of different arms.
        ImplausibleDataError: An invalid frequency response, or not in m/N.
        ArchiveError: Not the kind of file the option takes.
    """
    cell = read_cell(files.cell)
    remarks: list[str] = []
    compliance = _find_compliance(cell, files, remarks)
    response = _read_response(cell, files, remarks)
    learned = _read_deviation(files, remarks)
    held = _read_held_tool(files, remarks)
    models = SensingModels(
        robot=cell.robot,
        rate=rate,
        compliance=compliance,
        response=response,
        held=held,
        T_flange_sensor=np.eye(4) if files.sensor is None else _read_pose(files.sensor),
        learned=learned,
    )
    settings = SensingSettings()
    if files.force_most is not None:
        settings = replace(settings, force_most=files.force_most)
    sensing = Sensing(models, settings)
    remarks.append(
        f"estimates are marked as settling for {sensing.memory:.1f} s after the start and after "
        "every gap in the force"
    )
    return sensing, tuple(remarks)


def _find_compliance(cell: Cell, files: SensingFiles, remarks: list[str]) -> JointCompliance | None:
    if files.calibrated is not None:
        return _take_compliance(cell, files.calibrated, files.model, remarks)
    known = np.nan_to_num(np.asarray(cell.compliance_prior))
    if known.any():
        remarks.append(
            f"joint stiffness as stated in the cell, assumed accurate to {100.0 * STATED_SD:.0f} "
            "%: a calibrated --model is more accurate"
        )
        return JointCompliance(compliance=known, covariance=np.diag((STATED_SD * known) ** 2))
    remarks.append(
        "no stiffness of the joints: away from the pose of the hammer test the static part is "
        "that of the hammer test; --model, or stiffness_Nm_per_rad in the cell"
    )
    return None


def _take_compliance(
    cell: Cell, model: ErrorModel, path: Path | None, remarks: list[str]
) -> JointCompliance:
    """Compliances of a calibrated model, with their covariance where it has one."""
    if model.robot.dof != cell.robot.dof or model.robot.name != cell.robot.name:
        raise ModelMismatchError(
            f"a model of {model.robot.name}, the cell has {cell.robot.name}.", source=path
        )
    tables = model.mean_tables()
    known = np.zeros(0) if tables is None else np.asarray(tables.robot.error("compliance"))
    if not known.any():
        raise ModelMismatchError(
            "the model has no compliance of the joints.",
            source=path,
            hint="calibrate with --method elastic, ripple or gp and with payloads, or leave "
            "--model out and state stiffness_Nm_per_rad in the cell.",
        )
    physics = getattr(model, "physics", model)
    whole = getattr(physics, "covariance", None)
    if whole is None:
        remarks.append(f"{path}: no covariance of its stiffness; assumed accurate to 10 %")
        return JointCompliance(
            compliance=np.maximum(known, 0.0), covariance=np.diag((0.1 * known) ** 2)
        )
    part = parameter_slice(cell.robot.dof, "compliance")
    return JointCompliance(compliance=np.maximum(known, 0.0), covariance=whole[part, part])


def _read_response(cell: Cell, files: SensingFiles, remarks: list[str]) -> MeasuredResponse | None:
    if files.frf is None:
        if files.frf_joints is not None or files.frf_frame is not None:
            raise ConfigurationError("--frf-joints and --frf-frame state where --frf was measured.")
        remarks.append(
            "no frequency response: only the static part, under the force below "
            f"{SensingSettings().static_band:g} Hz; vibration is not included"
        )
        return None
    if files.frf_joints is None or files.frf_frame is None:
        raise ConfigurationError(
            "--frf needs the pose it was measured at and its axes.",
            source=files.frf,
            hint="--frf-joints A1,..,A6 as the controller displayed them, in deg, and --frf-frame "
            "base or tool.",
        )
    if files.frf_frame not in ("base", "tool"):
        raise ConfigurationError(f"--frf-frame {files.frf_frame!r}, expected base or tool.")
    frf = read_frf(files.frf)
    check_response(frf)
    remarks.extend(response_remarks(frf))
    modes = fit_modes(frf)
    misfit = rebuild_error(frf, modes)
    axes = set(frf.response_axes) & set(frf.excitation_axes)
    for axis in sorted(set("xyz") - axes):
        remarks.append(f"the response has no data along {axis}: only the arm deflects there")
    joints = _numbers(files.frf_joints, cell.robot.dof, "--frf-joints") * DEG
    return MeasuredResponse(
        oscillators=oscillators_of(modes),
        joints=cell.robot.controller.to_model(joints),
        frame=cast(Axes, files.frf_frame),
        misfit=max(LEAST_MISFIT, misfit),
    )


def provenances(files: SensingFiles) -> dict[str, Provenance]:
    """Returns where the models of the estimator come from, by the option that names them."""
    made: dict[str, Provenance] = {}
    if files.calibrated is not None:
        made["model"] = provenance_of(files.calibrated)
    if files.frf is not None:
        made["frf"] = read_frf(files.frf).provenance
    if files.tool is not None:
        made["tool"] = held_tool_from_archive(read_archive(files.tool)).provenance
    if files.deviation is not None:
        learned = read_learned_deviation(files.deviation)
        made["deviation"] = learned.windows.provenance
    return made


def _read_deviation(files: SensingFiles, remarks: list[str]) -> LearnedPart | None:
    if files.deviation is None:
        return None
    if files.spindle_rpm is None:
        raise ConfigurationError(
            "--deviation needs the speed of the spindle: it was learned of peaks per turn.",
            source=files.deviation,
            hint="--spindle-rpm.",
        )
    model = read_learned_deviation(files.deviation)
    shown = ", ".join(f"{v:g}" for v in model.arm.direction)
    remarks.append(
        f"the fitted deviation acts along ({shown}) of base; across it only the physical model is "
        "used"
    )
    return LearnedPart(model=model, spindle=files.spindle_rpm / 60.0)


def _read_held_tool(files: SensingFiles, remarks: list[str]) -> HeldTool | None:
    if files.tool is None:
        remarks.append(
            "no tool stated: the force is used as the process force, so tare the sensor in the "
            "attitude of the cut; --tool subtracts weight and offset in every attitude"
        )
        return None
    tool = held_tool_from_archive(read_archive(files.tool))
    remarks.append(
        f"{tool.mass:.2f} kg are on the sensor: their inertia under vibration stays in the force; "
        "the joints do not measure it"
    )
    return tool


def _read_pose(text: str) -> Array:
    numbers = _numbers(text, 6, "--sensor")
    return pose_from_xyz_abc(numbers[:3] * MM, numbers[3:] * DEG)


def _numbers(text: str, count: int, option: str) -> Array:
    numbers = parse_number_list(text)
    if len(numbers) != count:
        raise ConfigurationError(f"{option} {text!r}, expected {count} numbers with commas.")
    return numbers
