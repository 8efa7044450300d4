"""The beginning of a session at the part: features, its rough place, postures to reach them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from robotrue.app.workbench.file_imports import cell_of
from robotrue.app.workbench.model_views import from_simulation
from robotrue.app.workbench.probing_state import (
    TouchWords,
    require_kind,
    require_same_arm,
    settings_from,
)
from robotrue.calibration.model import ErrorModel
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode
from robotrue.core.poses import fit_rigid, pose_from_xyz_abc
from robotrue.core.provenance import read_provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.measurement.formats.part_points import (
    PLANNED,
    Features,
    PointsFile,
    read_features,
    read_points,
)
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.formats.table import AxisRelation
from robotrue.measurement.touch_session import ProbingSession, TouchFeature
from robotrue.planning.arm_scene import scene_of
from robotrue.planning.plan_defaults import LEAN_DEG, ROUGH_MM
from robotrue.planning.probing_candidates import TouchLimits, find_facing_posture, touch_candidates
from robotrue.robot.configuration import axis_relation
from robotrue.robot.forward import forward
from robotrue.robot.inverse import branches_of
from robotrue.robot.opw import opw_geometry
from robotrue.store import items, models
from robotrue.store.nouns import CELL, MODEL, DocumentRecord
from robotrue.store.registrations import add_session
from robotrue.store.workspace import Workspace
from robotrue.validation.registration_frame import TOUCH

AXES: Final[Mapping[str, tuple[float, float, float]]] = {
    "+x": (1.0, 0.0, 0.0), "-x": (-1.0, 0.0, 0.0), "+y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0), "+z": (0.0, 0.0, 1.0), "-z": (0.0, 0.0, -1.0),
}  # fmt: skip
STEEPER_DEG: Final = 10.0
"""Beyond the lean, by which the tool may be off the direction a feature is open to."""
MOST: Final = 300
"""Features of a session."""
FARTHEST: Final = 50.0
"""m, of a point or a part."""
POSTURES: Final = 20
"""Of a feature."""


def begin_probing(workspace: Workspace, stated: Mapping[str, object]) -> DocumentRecord:
    """Returns the record of a new session.

    Args:
        workspace: Where it is kept.
        stated: ``cell``, ``model``, ``paths``, ``name``, ``reads``, ``axes``, ``frame``,
            ``tip_axis``, ``lean_deg``, ``rough_mm``, and the lengths in mm of the settings.
    """
    cell_record = items.get(workspace, CELL, str(stated["cell"]))
    cell = cell_of(workspace, cell_record)
    model_record, model = None, None
    if stated.get("model"):
        model_record = items.get(workspace, MODEL, str(stated["model"]))
        model = models.model_of(workspace, model_record).model
    require_same_arm(cell, model)
    paths = decode(list[Path], stated["paths"], key="paths", error=ConfigurationError)
    if len(paths) != 1:
        raise ConfigurationError(f"{len(paths)} files, expected one table of features.")
    session = _session(cell, model, paths[0], stated)
    name = str(stated.get("name") or paths[0].stem)
    return add_session(
        workspace, session, name=name, cell=cell_record.ref,
        model=None if model_record is None else model_record.ref, files=paths,
    )  # fmt: skip


def _session(
    cell: Cell, model: ErrorModel | None, path: Path, stated: Mapping[str, object]
) -> ProbingSession:
    settings = _settings(stated)
    words = decode(TouchWords, settings, key="settings")
    settings_from(words, cell)  # refuses invalid sizes
    features, planned = _features(path, cell)
    rough = _rough(cell, str(stated.get("frame") or ""), features, planned)
    postures = _postures(cell, features, rough, words) if planned is None else planned
    reads = require_kind(str(stated.get("reads", "joints")), ("joints", "position"), "reads")
    if reads == "joints" and not any(postures):
        raise ConfigurationError("no feature is reachable.")
    nan = np.isnan(features.normal[:, 0])
    return ProbingSession(
        features=tuple(
            TouchFeature(
                name=features.names[k],
                part=int(features.part[k]),
                point_mm=_three(features.point[k] / MM),
                normal=None if nan[k] else _three(features.normal[k], 12),
                postures_deg=postures[k],
            )
            for k in range(len(features))
        ),
        parts=features.parts,
        rough=tuple(
            tuple(tuple(row) for row in rough[k].tolist()) for k in range(len(features.parts))
        ),
        reads="joints" if reads == "joints" else "position",
        settings=settings,
        simulated=from_simulation(model) or read_provenance(path).simulated,
    )


def _settings(stated: Mapping[str, object]) -> dict[str, object]:
    def number(name: str, default: float | None, least: float, most: float) -> float | None:
        given = stated.get(name)
        value = default
        if given is not None:
            value = decode(float, given, key=name, error=ConfigurationError)
        if value is not None and not least <= value <= most:
            raise ConfigurationError(f"{name} {value:g}, expected {least:g} to {most:g}.")
        return value

    axis = require_kind(str(stated.get("tip_axis") or "+z"), tuple(AXES), "tip axis")
    return {
        "touch_sigma_mm": number("touch_sigma_mm", TOUCH / MM, 1e-6, 100.0),
        "robot_sigma_mm": number("robot_sigma_mm", None, 0.0, 100.0),
        "tool_sigma_mm": number("tool_sigma_mm", None, 0.0, 100.0),
        "tolerance_mm": number("tolerance_mm", None, 1e-6, 100.0),
        "probe_radius_mm": number("probe_radius_mm", 0.0, 0.0, 100.0),
        "rough_mm": number("rough_mm", ROUGH_MM, 0.1, 1000.0),
        "lean_deg": number("lean_deg", LEAN_DEG, 0.0, 60.0),
        "tip_axis": list(AXES[axis]),
        "axes": require_kind(str(stated.get("axes") or "controller"), ("controller", "model"),
                             "axes"),
        "fit": require_kind(str(stated.get("fit") or "auto"), ("auto", "frame", "joint"), "fit"),
    }  # fmt: skip


def _features(
    path: Path, cell: Cell
) -> tuple[Features, list[tuple[tuple[float, ...], ...]] | None]:
    """Features of a file, and their joints where it is a plan of touches."""
    sheet = read_sheet(path)
    planned: list[tuple[tuple[float, ...], ...]] | None = None
    if sheet.has("a1_deg") or sheet.has("j1_deg") or sheet.has("x_mm"):
        file = _points(path, axis_relation(cell.robot))
        touches = file.touches
        if touches.has_joints and touches.joints.shape[1] != cell.robot.dof:
            raise FormatError(
                f"{touches.joints.shape[1]} joint columns, {cell.robot.name} has "
                f"{cell.robot.dof} joints.",
                source=path.name,
            )
        features = Features(
            names=touches.names, point=touches.point, normal=touches.normal,
            access=np.full_like(touches.normal, np.nan), part=touches.part, parts=file.parts,
        )  # fmt: skip
        if touches.has_joints:
            planned = [(tuple(np.round(row / DEG, 6).tolist()),) for row in touches.joints]
    else:
        features = read_features(path)
    if not 1 <= len(features) <= MOST:
        raise FormatError(f"{len(features)} features, expected 1 to {MOST}.", source=path.name)
    far = np.flatnonzero(np.abs(features.point).max(axis=1) > FARTHEST)
    if len(far):
        raise FormatError(
            f"point {features.names[far[0]]!r} is more than {FARTHEST:g} m from the part's origin.",
            source=path.name,
            hint="px_mm, py_mm, pz_mm are millimetres.",
        )
    for name in features.names:
        if name.startswith("#") or len(name) > 100:
            raise FormatError(
                f"a feature named {name[:40]!r}: a row that starts with # is a comment in tables.",
                source=path.name,
                hint="letters and numbers, up to 100 characters.",
            )
    return features, planned


def _points(path: Path, relation: AxisRelation) -> PointsFile:
    """Reads a file of points; the line that marks an unprobed plan is allowed here."""
    data = path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    if not data.startswith(PLANNED.encode()):
        return read_points(path, relation)
    with TemporaryDirectory() as folder:
        plain = Path(folder) / path.name
        plain.write_bytes(b"\n" + data.partition(b"\n")[2])
        return read_points(plain, relation)


def _rough(
    cell: Cell,
    frame: str,
    features: Features,
    planned: list[tuple[tuple[float, ...], ...]] | None,
) -> dict[int, Array]:
    """Roughly ``T_base_part`` of every part: as stated, as planned, or as the cell has it."""
    numbers = range(len(features.parts))
    if frame.strip():
        return dict.fromkeys(numbers, _parse_frame(frame))
    found: dict[int, Array] = {}
    if planned is not None:
        joints = np.array([each[0] for each in planned]) * DEG
        tip = forward(cell.robot.nominal(), joints)[:, :3, 3]
        for k in numbers:
            mine = features.part == k
            point = features.point[mine]
            size = np.linalg.svd(point - point.mean(axis=0), compute_uv=False)
            if len(point) >= 3 and size[1] > 1.0 * MM:
                found[k] = fit_rigid(point, tip[mine])
    known = {} if cell.part is None else {f.name: f.T_base_part for f in cell.part.frames}
    for k, name in enumerate(features.parts):
        if k not in found and known:
            found[k] = known.get(name, next(iter(known.values())))
        elif k not in found and not np.array_equal(cell.T_base_frame, np.eye(4)):
            found[k] = cell.T_base_frame
    lost = [features.parts[k] for k in numbers if k not in found]
    if lost:
        raise ConfigurationError(
            f"the approximate frame of part {lost[0]!r} in the robot base is not stated.",
            hint="X, Y, Z, A, B, C in mm and deg, to some centimetres.",
        )
    return found


def _parse_frame(text: str) -> Array:
    try:
        numbers = np.array([float(word) for word in text.replace(";", ",").split(",")])
    except ValueError:
        numbers = np.empty(0)
    if numbers.size != 6 or not (np.abs(numbers) <= np.repeat([FARTHEST / MM, 720.0], 3)).all():
        raise ConfigurationError(
            f"frame {text[:60]!r}, expected X, Y, Z, A, B, C in mm and deg.",
            hint="800, -100, 400, 0, 0, 0",
        )
    return pose_from_xyz_abc(numbers[:3] * MM, numbers[3:] * DEG)


def _postures(
    cell: Cell, features: Features, rough: Mapping[int, Array], words: TouchWords
) -> list[tuple[tuple[float, ...], ...]]:
    """Joints each feature can be touched with; the first is the plainest."""
    robot = cell.robot.nominal()
    axis, lean = np.array(words.tip_axis), words.lean_deg
    machining = find_facing_posture(robot, features, rough, axis)
    able = touch_candidates(
        robot,
        replace(features, names=tuple(str(k) for k in range(len(features)))),
        machining,
        rough,
        limits=TouchLimits(lean=lean * DEG, steepest=(lean + STEEPER_DEG) * DEG, tip_axis=axis),
        scene=scene_of(cell, clearance=0.0) if cell.obstacles else None,
    ).touches
    alike = np.ones(len(able), dtype=bool)
    if opw_geometry(robot) is not None:  # the elbow and shoulder must not flip in between
        alike = branches_of(robot, able.joints) == branches_of(robot, machining.joints)[0]
    out: list[list[tuple[float, ...]]] = [[] for _ in range(len(features))]
    for wanted in (alike, ~alike):
        full = [bool(each) for each in out]
        for k in np.flatnonzero(wanted).tolist():
            if not full[int(able.names[k])]:
                posture = tuple(np.round(able.joints[k] / DEG, 6).tolist())
                out[int(able.names[k])].append(posture)
    most = POSTURES if lean > 0.0 else 1
    return [tuple(each[:most]) for each in out]


def _three(values: Array, digits: int = 9) -> tuple[float, float, float]:
    x, y, z = np.round(values, digits).tolist()
    return x, y, z
