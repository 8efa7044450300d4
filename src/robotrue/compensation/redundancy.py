"""The free rotation about the axis of a rotating tool, chosen for stiffness and room.

With a rotating cutter the rotation of the tool frame about its axis is free; CAM or the post wrote
one. Here it is chosen again, run by run (:mod:`robotrue.compensation.redundancy_path`), by the
cheapest way through a grid of spins with two refinements (:mod:`robotrue.robot.spin` states the
rule): distance from joint limits and singularities, joint travel, and on top ``(deflection /
settings.deflection)^2`` per metre, the deflection being that of the arm under the process force
across the feed. A spin is counted from the written attitude, so zero changes nothing. Each run
keeps the arm's branch; a run that cannot be followed, or would gain less than a twentieth, stays as
written. Between stations spins are interpolated, and every run is checked once more as the
controller drives it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.compensation.compensate import compensate
from robotrue.compensation.process_force import DescribedForce
from robotrue.compensation.redundancy_path import DenseRun, SpinRun, dense_run, runs_of
from robotrue.compensation.redundancy_result import PostureQuality, SpinChoice
from robotrue.compensation.result import Compensation
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray, IntArray, frozen
from robotrue.core.poses import inverse as inverse_pose
from robotrue.core.poses import pose
from robotrue.core.rotations import matrix_from_rotation_vector, wrap
from robotrue.core.units import UM
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import CutPath, cut_path
from robotrue.program.lang import languages
from robotrue.program.program import Program
from robotrue.robot.configuration import configuration_words, renew_words
from robotrue.robot.forward import drive_jacobian, forward, walk
from robotrue.robot.inverse import ClosedArm, branches_of, inverse_branches, require_closed
from robotrue.robot.model import RobotModel
from robotrue.robot.spin import (
    TRIES,
    SpinPath,
    SpinSettings,
    cannot_follow,
    limit_cost,
    limit_room,
    refined_way,
    singular_cost,
    stations_of,
)

GAIN: Final = 0.05
"""Share of the cost that must be won, else a run stays as it is written."""
_BENT: Final = 8192
"""Targets looked at together."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeSpinSettings:
    """Settings for choosing the free rotation.

    Attributes:
        spin: Cutter axis, grid, margins, weight of joint travel.
        deflection: m across the feed that cost as much as one joint at 0.7 of its range.
        most: rad a spin may lie from the attitude that is written.
    """

    spin: SpinSettings
    deflection: float = 50.0 * UM
    most: float = np.pi

    def __post_init__(self) -> None:
        """Checks that both are above zero."""
        for name in ("deflection", "most"):
            if not getattr(self, name) > 0.0:
                raise ConfigurationError(f"{name} is {getattr(self, name)}, expected above 0.")


def require_free_spin(model: ErrorModel | None, force: Array | DescribedForce) -> None:
    """Checks that there is a model, and that the force does not turn with the tool frame.

    Raises:
        ConfigurationError: There is none, or it does.
    """
    if model is None:
        raise ConfigurationError(
            "--free-spin asks a calibrated model how the arm bends; here is only a cell.",
            hint="robotrue calibrate CELL MEASUREMENTS -o MODEL.",
        )
    if not isinstance(force, DescribedForce):
        return
    for part in force.parts:
        if part.axes == "tool":
            raise ConfigurationError(
                f"force {part.name!r} is in tool axes, which --free-spin turns.",
                hint='axes = "path" turns with the feed; axes = "base" stays fixed.',
            )


def compensate_with_spins(
    model: ErrorModel, program: Program, settings: CompensationSettings, cutter: Array
) -> tuple[Compensation, dict[str, object]]:
    """Returns the compensation of a program with newly chosen spins, and their benefit.

    Raises:
        ConfigurationError: As :func:`choose_spins`.
    """
    free = FreeSpinSettings(spin=SpinSettings(cutter=cutter))
    choice = choose_spins(model, program, free, settings=settings)
    result = choice.restate(program, compensate(model, choice.program, settings=settings))
    return result, {**choice.summary(), "notes": list(choice.notes)}


def choose_spins(
    model: ErrorModel,
    program: Program,
    free: FreeSpinSettings,
    *,
    settings: CompensationSettings | None = None,
) -> SpinChoice:
    """Returns the program with a newly chosen rotation about the tool axis.

    Args:
        model: Its compliance gives the deflection; without it, limits and singularities decide.
        program: As read.
        free: Cutter axis, grid, margins.
        settings: Its wrench is the process force; it must not turn with the tool frame.

    Raises:
        ConfigurationError: The arm is not ortho-parallel, or carries the part, or the language does
            not state the rotation.

    Fails when: a program returns to a point stored in a variable; that point has one attitude for
    all moves that end there, and targets are processed in file order. Obstacles are not considered.
    """
    settings = settings or CompensationSettings()
    robot = model.robot.nominal()
    geometry = require_closed(robot)
    _require_printed(program)
    base = compensate(model, program, settings=replace(settings, covariance=False))
    load = settings.load_for(len(program))
    wrench = np.broadcast_to(load.wrench, (len(program), 6))
    tables = model.mean_tables()
    compliance = np.zeros(6) if tables is None else tables.robot.error("compliance")
    task = _Task(
        robot=robot, geometry=geometry, compliance=compliance, program=program,
        path=cut_path(program, cutter=free.spin.cutter), wrench=wrench, free=free,
        joints=base.joints,
    )  # fmt: skip
    spin = np.zeros(len(program))
    rotation, after = np.array(program.rotation), np.array(base.joints)
    runs = runs_of(program, np.asarray(np.isfinite(base.joints).all(axis=1)))
    notes, turned = [], 0
    for run in runs:
        found = run.fault or _spin_run(task, run)
        if isinstance(found, str):
            if found:
                lines = program.line[run.rows[[0, -1]]]
                notes.append(f"lines {lines[0]} to {lines[1]}: not turned, {found}.")
            continue
        turned += 1
        free_rows = run.rows[1:] if run.fixed else run.rows
        skip = len(run.rows) - len(free_rows)
        spin[free_rows], after[run.rows] = found.spin[skip:], found.joints
        turn = matrix_from_rotation_vector(found.spin[skip:, None] * free.spin.cutter)
        rotation[free_rows] = program.rotation[free_rows] @ turn
    moved = np.asarray(np.abs(wrap(spin)) > 1e-12)
    return SpinChoice(
        program=replace(
            program, rotation=rotation, words=_words(robot, program, moved, base.joints, after)
        ),
        spin=spin,
        turned=moved,
        before=_posture_quality(task, base.joints),
        after=_posture_quality(task, after),
        runs=(len(runs), turned),
        notes=tuple(notes),
    )


def _require_printed(program: Program) -> None:
    """Refuses a program whose rotation about the tool axis is not its own to choose."""
    language = languages().get(program.dialect)
    if language is None or not language.prints_attitude:
        raise ConfigurationError(
            f"a {program.dialect} program does not print the rotation about the tool axis in full: "
            "what is chosen could not be written.",
            source=program.name,
            hint="make a robot program of it first (robotrue program chooses the rotation), or "
            "state [controller] spin_deg in the cell.",
        )
    if program.held.any():
        raise ConfigurationError(
            "the robot carries the part: its attitude is chosen by the program alone.",
            source=program.name,
            hint="leave the free spin off.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    robot: RobotModel
    geometry: ClosedArm
    compliance: Array
    program: Program
    path: CutPath
    wrench: Array
    free: FreeSpinSettings
    joints: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """Spins (n,) rad and joints (n, 6) rad of a run."""

    spin: Array
    joints: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scene:
    """One run with everything that does not change while spins are tried."""

    task: _Task
    run: SpinRun
    robot: RobotModel
    branch: int
    rotation: Array
    dense: DenseRun

    def joints(self, at: IntArray, attitude: Array, reference: Array) -> Array:
        """Joints (m, ..., 6) of the branch at dense points (m,), attitudes (m, ..., 3, 3)."""
        shape = attitude.shape[1:-2]
        place = self.dense.position[at].reshape(len(at), *(1,) * len(shape), 3)
        T = pose(attitude, np.broadcast_to(place, (len(at), *shape, 3)))
        T_base_flange = (T @ inverse_pose(self.robot.T_flange_tool)).reshape(-1, 4, 4)
        found = inverse_branches(self.robot, T_base_flange, reference=reference)
        return np.asarray(found[:, self.branch].reshape(len(at), *shape, 6))

    def push_cost(self, at: IntArray, joints: Array) -> Array:
        """Cost per metre (m, ...) of the deflection at dense points with joints (m, ..., 6)."""
        shape = joints.shape[1:-1]
        rows = self.run.rows[self.dense.target[at]]
        each = np.repeat(rows, int(np.prod(shape, dtype=np.int64)))
        task = self.task
        moved = bending(self.robot, task.compliance, joints.reshape(-1, 6), task.wrench[each])
        size = np.linalg.norm(across(moved, task.path.feed_direction[each]), axis=1)
        return np.asarray((size / task.free.deflection) ** 2).reshape(len(at), *shape)


def _spin_run(task: _Task, run: SpinRun) -> _Found | str:
    """The run with new spins, or why it stays."""
    program, spin = task.program, task.free.spin
    branch = branches_of(task.robot, task.joints[run.rows])
    posed = run.rows[1:] if run.fixed else run.rows
    if (branch != branch[-1]).any():
        return "the arm changes its configuration among them"
    robot = task.robot.with_tool(program.T_flange_tool[program.tool[posed[0]]])
    T = np.array(task.path.T_base_tool[run.rows])
    if run.fixed:
        T[0] = forward(robot, task.joints[run.rows[:1]])[0]
    scene = _Scene(
        task=task,
        run=run,
        robot=robot,
        branch=int(branch[-1]),
        rotation=T[:, :3, :3],
        dense=dense_run(T[:, :3, 3], T[:, :3, :3], program.motion[run.rows]),
    )
    spacing = spin.spacing
    why = ""
    for _ in range(TRIES):
        stations = stations_of(scene.dense.along, spacing)
        way = _way(scene, stations)
        if way.branch < 0:
            return why or "a joint limit or a singularity blocks every rotation"
        found = _as_driven(scene, stations, way)
        if found is not None:
            return found if _gains(scene, found) else ""
        why = "a joint limit or a singularity is too near between them"
        spacing *= 0.5
    return why


def _way(scene: _Scene, stations: IntArray) -> SpinPath:
    """The cheapest way of spins over the stations."""
    free, near = scene.task.free, scene.task.joints[scene.run.rows[0]]
    attitude = scene.dense.attitudes(scene.rotation)[stations]
    length = np.diff(scene.dense.along[stations], prepend=scene.dense.along[stations[0]])

    def stand(spin: Array) -> tuple[Array, Array]:
        turn = matrix_from_rotation_vector(spin[..., None] * free.spin.cutter)
        joints = scene.joints(stations, attitude[:, None] @ turn, near)
        extra = scene.push_cost(stations, joints)
        extra = np.where(np.abs(wrap(spin)) > free.most, np.inf, extra)
        if scene.run.fixed:
            extra[0] = np.where(np.abs(wrap(spin[0])) > 1e-9, np.inf, extra[0])
        return joints[:, None], extra[:, None]

    return refined_way(scene.robot, scene.task.geometry, stand, length, free.spin, near=near)


def _as_driven(scene: _Scene, stations: IntArray, way: SpinPath) -> _Found | None:
    """Spins and joints of the targets if the arm follows all the way; None if it does not."""
    dense, settings = scene.dense, scene.task.free.spin
    at = dense.along[stations]
    spin = np.interp(dense.along[dense.at], at, way.spin)
    spin -= 2.0 * np.pi * np.rint(spin[0] / (2.0 * np.pi))
    turned = scene.rotation @ matrix_from_rotation_vector(spin[:, None] * settings.cutter)
    guess = np.stack([np.interp(dense.along, at, q) for q in way.joints.T], axis=1)
    joints = scene.joints(np.arange(len(dense.along)), dense.attitudes(turned), guess)
    bad = cannot_follow(scene.robot, scene.task.geometry, joints, settings)
    return None if bad.any() else _Found(spin=spin, joints=joints[dense.at])


def _gains(scene: _Scene, found: _Found) -> bool:
    """True if the new spins cost less than the written ones, by more than a twentieth."""
    task, at = scene.task, scene.dense.at
    length = np.diff(scene.dense.along[at], prepend=0.0)
    cost = [
        np.where(length > 0.0, length, 0.0)
        @ np.nan_to_num(
            limit_cost(scene.robot, joints, task.free.spin)
            + singular_cost(task.geometry, joints, task.free.spin)
            + scene.push_cost(at, joints),
            nan=np.inf,
            posinf=1e300,
        )
        for joints in (task.joints[scene.run.rows], found.joints)
    ]
    return bool(cost[1] < (1.0 - GAIN) * cost[0])


def _posture_quality(task: _Task, joints: Array) -> PostureQuality:
    """Returns the quality of the arm's posture at every target, tool by tool."""
    program, n = task.program, len(joints)
    moved = np.full((n, 3), np.nan)
    known = np.isfinite(joints).all(axis=1)
    for tool in np.unique(program.tool[known]):
        rows = np.flatnonzero(known & (program.tool == tool))
        if 0 <= tool < len(program.T_flange_tool):
            robot = task.robot.with_tool(program.T_flange_tool[tool])
            moved[rows] = bending(robot, task.compliance, joints[rows], task.wrench[rows])
    return PostureQuality(
        joints=frozen(joints, (n, 6), "joints", allow_nan=True),
        room=limit_room(task.robot, joints),
        wrist=np.arcsin(np.minimum(task.geometry.singular_measures(joints)[:, 0], 1.0)),
        across=np.linalg.norm(across(moved, task.path.feed_direction), axis=1),
        stiffness=stiffness(task.wrench, moved),
    )


def _words(
    robot: RobotModel, program: Program, moved: BoolArray, before: Array, after: Array
) -> IntArray:
    """Configuration words (n, w) of the new attitudes; those written where they stay true."""
    out = np.array(program.words)
    spoken = (program.words != NO_WORD).any(axis=1)
    rows = np.flatnonzero(moved & spoken)
    if robot.maker != program.words_of or not len(rows):
        return out
    maker, written = program.words_of, program.words[rows]
    had, have = (configuration_words(robot, maker, joints[rows]) for joints in (before, after))
    new = renew_words(maker, written, had, have)
    out[rows] = np.where(new == NO_WORD, written, new)
    return out


def bending(robot: RobotModel, compliance: Array, joints: Array, wrench: Array) -> Array:
    """Returns the shift of the tool point by a wrench (n, 3) m in base, by joint compliance.

    ``dx = J C J^T w`` with the drives' compliance C; the wrench alone, without gravity.

    Args:
        robot: The nominal arm with the tool.
        compliance: (6,) rad/(N m) of the drives.
        joints: (n, 6) rad; NaN gives NaN.
        wrench: (n, 6) N, N m on the tool, at the tool point, in base axes.
    """
    out = np.empty((len(joints), 3))
    for start in range(0, len(joints), _BENT):
        part = slice(start, start + _BENT)
        lever = drive_jacobian(robot, walk(robot, joints[part]))
        torque = np.einsum("nij,ni->nj", lever, wrench[part])
        out[part] = np.einsum("nij,nj->ni", lever[:, :3], compliance * torque)
    return out


def across(vector: Array, direction: Array) -> Array:
    """Returns vectors (n, 3) without their part along unit directions (n, 3); NaN takes nothing."""
    along = np.sum(vector * direction, axis=1, keepdims=True)
    return np.asarray(vector - np.where(np.isnan(along), 0.0, along * np.nan_to_num(direction)))


def stiffness(wrench: Array, moved: Array) -> Array:
    """Returns force over its own deflection (n,) N/m, ``|f|^2 / (f . dx)``; NaN without force."""
    force = wrench[:, :3]
    work = np.sum(force * moved, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(work > 0.0, np.sum(force * force, axis=1) / work, np.nan))
