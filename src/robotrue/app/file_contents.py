"""Content of a file, recognised by its bytes and not by its name."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table
from robotrue.app.reporting import place_in_file
from robotrue.calibration.model import ErrorModel, provenance_of
from robotrue.cell.cell import Cell
from robotrue.cell.config import read_cell
from robotrue.cell.part import PartTable
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.files import read_bytes
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM, UM
from robotrue.errors import FormatError
from robotrue.measurement.formats.mapping import read_mapping
from robotrue.measurement.formats.measured_files import open_sheet
from robotrue.measurement.formats.table import read_run
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.repeated_poses import average_repeats, describe_repeats
from robotrue.program.formats import detect, read_job
from robotrue.program.formats.apt import looks_like_apt
from robotrue.program.formats.toolpath_csv import is_toolpath_header
from robotrue.program.formats.toolpaths import read_toolpath
from robotrue.program.identity import ProgramIdentity, read_identity
from robotrue.program.program import FrameTable, Motion, Program, Reason
from robotrue.program.toolpath import Toolpath, cut_length
from robotrue.report.model_view import (
    drive_errors,
    list_geometric_errors,
    remarks,
    result_facts,
    stiffness,
)
from robotrue.robot.forward import forward
from robotrue.store.model_file import ModelFile, read_model

WORKBOOKS: Final = (".xlsx", ".xlsm", ".xls", ".xlsb", ".ods")
LOOKED_AT: Final = 1 << 18
"""Bytes that decide whether a file is a tool path."""
TABLES: Final = (".csv", ".tsv", ".txt")
REMARKS: Final = ("doubts", "notes")


def describe_file(path: Path, mapping: Path | None) -> PlainResult:
    """Returns the content of a file; with a mapping it holds measurements.

    Raises:
        FormatError: No known content.
    """
    data = read_bytes(path)
    if data.startswith(b"PK") and path.suffix.lower() not in WORKBOOKS:
        return _model_result(path, read_model(path))
    origin = None
    words: dict[str, str] = {}
    untold = mapping is None and path.suffix.lower() not in WORKBOOKS
    if untold and _is_cell(path, data):
        cell = read_cell(path)
        document = cell_document(cell)
        if cell.part is not None:
            origin, words = cell.part.provenance, {"part": _tell_part(cell.part)}
    elif untold and _is_toolpath(data):
        document = toolpath_document(read_toolpath(path))
    elif untold and _is_program(path, data):
        document = program_document(read_job(path, FrameTable()))
        if (known := read_identity(path, data)) is not None:
            document |= _program_identity(known)
            origin, words = known.provenance, {"identity": _tell_identity(known)}
    else:
        rows, remarks = _measurements(path, mapping)
        document, origin = measurement_document(rows), rows.provenance
        document |= {"notes": remarks} if remarks else {}
    shown = document_blocks(path.name, document, words)
    return PlainResult(values=document, shown=shown, provenance=origin)


def _model_result(path: Path, stored: ModelFile) -> PlainResult:
    """A model: what it came to, the errors it found, the stiffness, where it came from."""
    summary, cell = stored.model.training_summary(), stored.cell
    facts = Facts(
        title=f"{path.name}: error model of {stored.model.robot.name}",
        rows=(
            *result_facts(summary),
            ("measured", "; ".join(summary.sources) or "not recorded"),
            ("training data", f"sha256:{summary.data_sha256 or 'not recorded'}"),
            ("cell", f"{cell.source or 'made in code'} sha256:{cell.digest or 'none'}"),
            ("tracker frame", "the robot base" if cell.frame == "base" else "estimated by the fit"),
            ("kind", f"{stored.archive.kind}, schema {stored.archive.schema}"),
        ),
    )
    return PlainResult(
        values=model_document(stored),
        shown=(facts, *_error_tables(stored.model), *map(Note, remarks(stored.model))),
        provenance=provenance_of(stored.model),
    )


def _error_tables(model: ErrorModel) -> Iterable[Table]:
    """The tables of what was identified; a kind of error the model does not have has none."""
    if errors := list_geometric_errors(model):
        yield Table(
            title="identified errors, actual minus nominal",
            columns=("", "value", "sd", "unit", "known"),
            rows=tuple(
                (name, _format_signed(row["value"]), _plain(row["sd"]), row["unit"], row["known"])
                for name, row in errors.items()
            ),
        )
    if springs := stiffness(model):
        yield Table(
            title="stiffness of the drives",
            columns=("", "N m/rad", "sd", "known"),
            rows=tuple(
                (name, _big(row["Nm_per_rad"]), _big(row["sd_Nm_per_rad"]), row["known"])
                for name, row in springs.items()
            ),
        )
    if drives := drive_errors(model):
        yield Table(
            title="ripple and backlash of the drives",
            columns=("", "ripple rms, 0.001 deg", "strongest, per turn", "backlash, 0.001 deg"),
            rows=tuple(
                (
                    name,
                    f"{row['ripple_mdeg']:.2f}",
                    str(row["strongest"]) if row["ripple_mdeg"] >= 0.005 else "none",
                    f"{row['backlash_mdeg']:+.2f}",
                )
                for name, row in drives.items()
            ),
        )


def model_document(stored: ModelFile) -> dict[str, object]:
    """Returns a model file's kind, training summary, identified errors, stiffness and cell."""
    cell = stored.cell
    return {
        "holds": "error model",
        "kind": stored.archive.kind,
        "schema": stored.archive.schema,
        "robot": stored.model.robot.name,
        **stored.model.training_summary(),
        "identified": list_geometric_errors(stored.model),
        "stiffness": stiffness(stored.model),
        "drives": drive_errors(stored.model),
        "cell": {
            "source": cell.source,
            "sha256": cell.digest,
            "tracker_frame": "base" if cell.frame == "base" else "unknown",
        },
    }


def cell_document(cell: Cell) -> dict[str, object]:
    """Returns what was understood of a cell.toml."""
    robot = cell.robot
    home = forward(robot, np.zeros((1, robot.dof)))[0, :3, 3]
    return {
        "holds": "cell",
        "robot": robot.name,
        "maker": robot.maker,
        "convention": robot.convention,
        "reach_mm": robot.reach / MM,
        "tool_at_zero_mm": (home / MM).round(4).tolist(),
        "moving_mass_kg": float(robot.link_mass.sum()),
        "payload_kg": float(cell.payload.mass[0]),
        "limits_deg": (robot.limits / DEG).round(4).tolist(),
        "target_mm": (cell.T_flange_target[:3, 3] / MM).tolist(),
        "tracker_frame": "base" if cell.frame == "base" else "unknown",
        "tracker": cell.tracker.name,
        "tracker_sigma_at_3m_um": float(cell.tracker.sigma_range(np.array(3.0))) / UM,
        "repeatability_mm": cell.repeatability / MM,
        **({} if cell.part is None else {"part": _part_document(cell.part)}),
        **({"controller": _controller_document(cell)} if cell.says_of_controller else {}),
    }


def _controller_document(cell: Cell) -> dict[str, object]:
    controller = cell.controller
    return {
        "bases": sorted(controller.bases),
        "tools": sorted(controller.tools),
        "external": [
            {
                "axis": axis.number,
                "kind": "along" if axis.point is None else "about",
                "direction": axis.direction.tolist(),
                "carries": ["robot"] if axis.carries_robot else list(axis.frames),
            }
            for axis in controller.external
        ],
        "external_axes_at_rest": controller.external_axes_at_rest,
        "fixed_tool": controller.fixed_tool or None,
        "start_deg": (controller.start / DEG).tolist() if len(controller.start) else None,
        "pulses_per_degree": None
        if controller.pulses_per_degree is None
        else np.asarray(controller.pulses_per_degree).tolist(),
    }


def _part_document(part: PartTable) -> dict[str, object]:
    return {
        "method": part.method,
        "points": part.points_file,
        "model": {**part.identity.document(), "file": part.model_file},
        "frames": [frame.document() for frame in part.frames],
    }


def _program_identity(known: ProgramIdentity) -> dict[str, object]:
    """Returns the identity that the file next to a program states."""
    return {
        "identity": {
            "model": known.model.document(),
            "compensated": known.compensated,
            "part": known.part,
            "made_from": known.made_from,
        }
    }


def measurement_document(measurements: MeasurementSet) -> dict[str, object]:
    """Returns counts, extent and noise of a measurement file."""
    span = np.ptp(measurements.position, axis=0) / MM
    turns = np.stack([measurements.joints.min(axis=0), measurements.joints.max(axis=0)], axis=1)
    sigma = np.sqrt(np.trace(measurements.covariance, axis1=1, axis2=2) / 3.0) / UM
    return {
        "holds": "measurements",
        "poses": len(measurements),
        "joints": measurements.dof,
        "frame": measurements.frame,
        "full_poses": int(measurements.has_rotation.sum()),
        "loaded_poses": int((np.abs(measurements.wrench).max(axis=1) > 0.0).sum()),
        "extent_mm": span.round(1).tolist(),
        "joint_range_deg": (turns / DEG).round(2).tolist(),
        "mean_sigma_um": float(sigma.mean()),
        "sets": list(measurements.group_names),
        "sources": list(measurements.sources),
    }


def program_document(job: Sequence[Program]) -> dict[str, object]:
    """Returns counts by motion and by reason of a program and its companions."""
    motions: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for program in job:
        motions.update(Motion(int(m)).name.lower() for m in program.motion)
        reasons.update(Reason(int(r)).name.lower() for r in program.reason)
    reasons.pop(Reason.NONE.name.lower(), None)
    return {
        "holds": "program",
        "dialect": job[0].dialect,
        "files": [program.name for program in job],
        "targets": sum(len(program) for program in job),
        "motions": dict(motions),
        "left_alone": dict(reasons),
        "notes": [place_in_file(each.name, note) for each in job for note in each.notes],
    }


def _is_cell(path: Path, data: bytes) -> bool:
    if path.suffix.lower() == ".toml":
        return True
    try:
        return "robot" in tomllib.loads(data.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False


def toolpath_document(path: Toolpath) -> dict[str, object]:
    """Returns points, lengths and feeds of a tool path, and what was not understood."""
    feeds = path.feed[path.cutting & np.isfinite(path.feed)] * 60.0 / MM
    return {
        "holds": "tool path",
        "points": len(path),
        "rapid_points": int(path.rapid.sum()),
        "cut_mm": cut_length(path) / MM,
        "extent_mm": (np.ptp(path.position, axis=0) / MM).tolist(),
        "feed_mm_per_min": [[float(feeds.min()), float(feeds.max())]] if len(feeds) else [],
        "tool_axes": len(np.unique(np.round(path.axis, 6), axis=0)),
        "operations": list(path.operations),
        "tools": [name for name, _ in path.tools],
        "notes": list(path.notes),
    }


def _is_toolpath(data: bytes) -> bool:
    head = data[:LOOKED_AT].decode("latin-1").removeprefix("\xef\xbb\xbf")
    return is_toolpath_header(head) or looks_like_apt(head)


def _is_program(path: Path, data: bytes) -> bool:
    try:
        detect(data, path.name)
    except FormatError:
        return False
    return True


def _measurements(path: Path, mapping: Path | None) -> tuple[MeasurementSet, list[str]]:
    """The rows, and remarks; axes of a controller stay as they are: no robot is known here."""
    try:
        sheet, layout = open_sheet(path, None if mapping is None else read_mapping(mapping))
        run = read_run(sheet, layout, relation=np.asarray)
    except FormatError as cause:
        if mapping is not None or path.suffix.lower() in (*WORKBOOKS, *TABLES):
            raise
        raise FormatError(
            f"not a model, cell, program or measurement file that is known here ({cause.message})",
            source=path,
            line=cause.line,
            hint="robotrue inspect takes model files, cell.toml, KRL programs and measurements.",
        ) from cause
    remarks = list(run.remarks)
    if layout.repeats == "rows":
        remarks += describe_repeats(average_repeats(run.rows))
    if layout.axes == "controller":
        remarks.append("joint ranges are those of the controller's axes")
    return run.rows, remarks


def cell_blocks(name: str, cell: Cell) -> tuple[Block, ...]:
    """Returns what was understood of a cell, under a name."""
    words = {} if cell.part is None else {"part": _tell_part(cell.part)}
    return document_blocks(name, cell_document(cell), words)


def document_blocks(
    name: str, document: Mapping[str, object], words: Mapping[str, str] = MappingProxyType({})
) -> tuple[Block, ...]:
    """Returns a document of this file as facts, its remarks as notes, under a name.

    Args:
        name: Of the file.
        document: JSON values.
        words: Facts by key, where the values alone are not enough.
    """
    facts = Facts(
        title=f"{name}: {document['holds']}",
        rows=tuple(
            (key.replace("_", " "), words[key] if key in words else _words(value))
            for key, value in document.items()
            if key not in (*REMARKS, "holds")
        ),
    )
    lines = (
        f"{key.removesuffix('s')}: {line}"
        for key in REMARKS
        for line in decode(list[str], document.get(key, ()), key=key)
    )
    return (facts, *map(Note, lines))


def _tell_part(part: PartTable) -> str:
    frames = "; ".join(
        f"{frame.name} at {_three(frame.T_base_part[:3, 3] / MM + 0.0)} mm, "
        f"{_three(abc_from_matrix(frame.T_base_part[:3, :3]) / DEG + 0.0)} deg, {frame.verdict}"
        for frame in part.frames
    )
    return f"{frames}; with {part.identity}"


def _tell_identity(program: ProgramIdentity) -> str:
    done = "compensated" if program.compensated else "not compensated"
    where = f", part {program.part}" if program.part else ""
    return f"{done}, {program.model}{where}"


def _three(values: Array) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


def _words(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{number} {name}" for name, number in value.items()) or "none"
    if isinstance(value, list):
        if value and isinstance(value[0], list):
            return ", ".join(f"{low:g} to {high:g}" for low, high in value)
        return ", ".join(_words(part) for part in value) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _format_signed(value: float) -> str:
    return f"{value:+.4f}"


def _plain(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else "not recorded"


def _big(value: float | None) -> str:
    return "not known" if value is None else f"{value:,.0f}"
