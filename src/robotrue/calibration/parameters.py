"""Estimated parameters: one named vector of blocks, and the state that it updates.

Blocks: ``robot`` (the error vector of :class:`RobotModel`, 9 dof + 12), ``station/k`` (6: pose of a
tracker frame that is not known, or of a part that is touched; 3: a place that has no axes of its
own, such as a socket), ``target/k`` (3 or 6: a further reflector on the flange; reflector 0 is the
robot's own tool). A step is a vector in this layout; poses move on their manifold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.robot.model import PER_JOINT, POSE_TERMS, RobotModel, parameter_names


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterLayout:
    """Position of each block in the parameter vector.

    Attributes:
        dof: Number of joints.
        stations: Indices of the tracker frames to be estimated.
        targets: (index, size) of the further reflectors; size 3 (point) or 6 (pose).
        places: Which of the stations are places only: they shift (3), their axes are the base's.
    """

    dof: int
    stations: tuple[int, ...] = ()
    targets: tuple[tuple[int, int], ...] = ()
    places: tuple[int, ...] = ()

    @property
    def robot_size(self) -> int:
        """Length of the ``robot`` block."""
        return len(PER_JOINT) * self.dof + 12

    @property
    def size(self) -> int:
        """Length of the whole vector."""
        return self.robot_size + sum(size for _, size in (*self._stations, *self.targets))

    @property
    def _stations(self) -> tuple[tuple[int, int], ...]:
        return tuple((k, 3 if k in self.places else 6) for k in self.stations)

    @property
    def blocks(self) -> dict[str, slice]:
        """Name of each block and its slice."""
        out = {"robot": slice(0, self.robot_size)}
        start = self.robot_size
        for kind, entries in (
            ("station", self._stations),
            ("target", self.targets),
        ):
            for index, size in entries:
                out[f"{kind}/{index}"] = slice(start, start + size)
                start += size
        return out

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every parameter: ``theta1 .. tool_rz, station/0_x .. target/1_z``."""
        out = list(parameter_names(self.dof))
        for block, place in list(self.blocks.items())[1:]:
            out.extend(f"{block}_{term}" for term in POSE_TERMS[: place.stop - place.start])
        return tuple(out)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A point in parameter space.

    Attributes:
        robot: The arm with its current errors.
        T_tracker_base: Per station (4, 4).
        T_flange_target: Per further reflector (4, 4).
    """

    robot: RobotModel
    T_tracker_base: Mapping[int, Array] = field(default_factory=dict)
    T_flange_target: Mapping[int, Array] = field(default_factory=dict)


def retract(layout: ParameterLayout, state: State, step: Array) -> State:
    """Returns the state moved by ``step`` (size,), SI.

    A station or target pose moves by a shift and a left rotation about its own origin:
    t + v, exp([phi]x) R.
    """
    blocks = layout.blocks
    return State(
        robot=state.robot.with_errors(state.robot.errors + step[blocks["robot"]]),
        T_tracker_base={
            k: _move_pose(T, step[blocks[f"station/{k}"]]) for k, T in state.T_tracker_base.items()
        },
        T_flange_target={
            k: _move_pose(T, step[blocks[f"target/{k}"]]) for k, T in state.T_flange_target.items()
        },
    )


def difference(layout: ParameterLayout, state: State, origin: State) -> Array:
    """Returns the step (size,) that takes ``origin`` to ``state``: the inverse of retract."""
    blocks = layout.blocks
    out = np.zeros(layout.size)
    out[blocks["robot"]] = state.robot.errors - origin.robot.errors
    for kind, new, old in (
        ("station", state.T_tracker_base, origin.T_tracker_base),
        ("target", state.T_flange_target, origin.T_flange_target),
    ):
        for k, T in new.items():
            place = blocks[f"{kind}/{k}"]
            step = np.concatenate(
                [
                    T[:3, 3] - old[k][:3, 3],
                    rotation_vector_from_matrix(T[:3, :3] @ old[k][:3, :3].T),
                ]
            )
            out[place] = step[: place.stop - place.start]
    return out


def station_as_base(layout: ParameterLayout, state: State) -> tuple[slice, Array] | None:
    """Returns a station's block and the (6, 6) map of its step to one of the base errors.

    With an unknown tracker frame the base *is* where that station says: the joint offsets and the
    station are known only together, and only together do they say where a measured point will be.
    The first station that has axes stands for the base; a place has none. None where no station is
    estimated, or only places.
    """
    frames = [k for k in layout.stations if k not in layout.places]
    if not frames:
        return None
    first = frames[0]
    back = state.T_tracker_base[first][:3, :3].T
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = back
    return layout.blocks[f"station/{first}"], out


def target_as_tool(layout: ParameterLayout, target: int, T_flange_target: Array) -> Array:
    """Returns the (6, size) map of a step to the tool errors of an arm that carries the target.

    A target shifts along the flange's axes, a tool along its own; turns are left out, no point
    depends on them.
    """
    out = np.zeros((6, layout.size))
    start = layout.blocks[f"target/{target}"].start
    out[:3, start : start + 3] = T_flange_target[:3, :3].T
    return out


def _move_pose(transform: Array, step: Array) -> Array:
    out = transform.copy()
    out[:3, 3] += step[:3]
    if len(step) == 6:
        out[:3, :3] = matrix_from_rotation_vector(step[3:]) @ transform[:3, :3]
    return out
