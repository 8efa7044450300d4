"""A URDF file as a robot model, exactly: modified DH by common normals.

Frame i of the model is on joint axis i with x along the common normal to axis i + 1. Frame n, the
model's flange, is on the last axis at the foot of the tip; the transform between it and the tip
link (identity where the tip's z is along the last axis, as for ``tool0``) becomes
``T_flange_tool``, because a DH table ends on its last axis.

Source: Craig, Introduction to Robotics, section 3.4, for the frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose
from robotrue.core.poses import inverse as inverse_pose
from robotrue.errors import ConfigurationError, FormatError
from robotrue.robot.model import RobotModel
from robotrue.robot.urdf_tree import UrdfJoint, UrdfTree, read_tree
from robotrue.robot.urdf_writer import to_urdf

__all__ = ["from_urdf", "to_urdf"]

_PARALLEL: Final = 1e-9  # sine below which axes are parallel: 1 nm on 1 m
_ROUNDED: Final = 1e-4  # sine below which a common normal would lie kilometres away
_TIPS: Final = ("tool0", "flange")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chain:
    """Joint axes and bodies at zero, in the root link's frame."""

    joints: tuple[UrdfJoint, ...]
    axis: Array  # (n, 3)
    point: Array  # (n, 3)
    T_base_tip: Array
    mass: Array  # (n,)
    com: Array  # (n, 3)


def from_urdf(
    path: str | Path,
    tip: str | None = None,
    *,
    right_angle: float = 0.0,
    data: bytes | None = None,
) -> RobotModel:
    """Returns the serial arm of a URDF file as a modified-DH model; equal to it to 1e-9 m.

    Fixed joints are merged, with the masses of their links. Masses before the first joint are left
    out. Continuous joints get limits of +-360 deg.

    Args:
        path: The file (URDF, not xacro).
        tip: Last link; the leaf after most joints if not given, ``tool0`` or ``flange`` where there
            are several.
        right_angle: rad; ``rpy`` angles this near to a multiple of 90 deg are taken as exact, for
            files that print 1.5708.
        data: Content of the file; None: read from the path.

    Raises:
        FormatError: Not a URDF, or a joint on the way to the tip that is not revolute or that
            follows another one; with the line.
        ConfigurationError: No or several possible tips; a first axis that no DH table reaches from
            the root link; axes parallel but for rounding; masses on moving side branches.
    """
    tree = read_tree(path, right_angle=right_angle, data=data)
    chain = _walk(tree, _path_to(tree, tip))
    x, origin = _frames(chain, tree)
    n = len(chain.axis)
    table = np.empty((4, n))  # theta, d, a, alpha
    before_x, before_z, before_o = np.eye(3)[0], np.eye(3)[2], np.zeros(3)
    for i, z in enumerate(chain.axis):
        step = origin[i] - before_o
        table[:, i] = (
            _angle(before_x, x[i], z),
            step @ z,
            step @ before_x,
            _angle(before_z, z, before_x),
        )
        before_x, before_z, before_o = x[i], z, origin[i]
    frames = pose(np.stack([x, np.cross(chain.axis, x), chain.axis], axis=2), origin)
    theta, d, a, alpha = _clean(table)
    return RobotModel(
        name=tree.name,
        convention="mdh",
        theta=theta,
        d=d,
        a=a,
        alpha=alpha,
        limits=np.array([joint.limits for joint in chain.joints]),
        link_mass=chain.mass,
        link_com=apply(inverse_pose(frames), chain.com) * (chain.mass > 0.0)[:, None],
        T_flange_tool=inverse_pose(frames[-1]) @ chain.T_base_tip,
    )


def _path_to(tree: UrdfTree, tip: str | None) -> list[UrdfJoint]:
    """Joints from the root link to the tip."""
    into = {joint.child: joint for joint in tree.joints}

    def way(link: str) -> list[UrdfJoint]:
        steps: list[UrdfJoint] = []
        while link in into and len(steps) <= len(tree.joints):
            steps.append(into[link])
            link = into[link].parent
        return steps[::-1]

    if tip is None:
        tip = _choose_tip(
            tree, {name: sum(j.kind != "fixed" for j in way(name)) for name in tree.links}
        )
    elif tip not in tree.links:
        raise ConfigurationError(
            f"no link {tip!r}; there are {', '.join(tree.links)}.", source=tree.source
        )
    steps = way(tip)
    for joint in steps:
        if joint.kind not in ("fixed", "revolute", "continuous") or joint.mimic:
            what = "follows another joint (mimic)" if joint.mimic else f"is {joint.kind}"
            raise FormatError(
                f"joint {joint.name!r} {what}; only serial revolute arms are supported.",
                source=tree.source,
                line=joint.line,
                hint="name a tip link before it.",
            )
    if not any(joint.kind != "fixed" for joint in steps):
        raise ConfigurationError(f"no moving joint before link {tip!r}.", source=tree.source)
    return steps


def _choose_tip(tree: UrdfTree, moving: dict[str, int]) -> str:
    parents = {joint.parent for joint in tree.joints}
    most = max(moving.values(), default=0)
    leaves = [name for name in tree.links if name not in parents and moving[name] == most]
    if len(leaves) == 1:
        return leaves[0]
    for wanted in _TIPS:
        named = [name for name in leaves if name.endswith(wanted)]
        if len(named) == 1:
            return named[0]
    raise ConfigurationError(
        f"several links could be the tip: {', '.join(leaves)}.",
        source=tree.source,
        hint=f"tip={leaves[0]!r}." if leaves else None,
    )


def _walk(tree: UrdfTree, steps: list[UrdfJoint]) -> _Chain:
    """Places every joint of the chain at zero and gathers the masses each one carries."""
    T = np.eye(4)
    axis, point, moving = [], [], []
    mass: list[float] = []
    moment: list[Array] = []
    on_chain = {joint.name for joint in steps}
    for joint in steps:
        T = T @ joint.T_parent_joint
        if joint.kind != "fixed":
            moving.append(joint)
            axis.append(T[:3, :3] @ joint.axis)
            point.append(T[:3, 3])
            mass.append(0.0)
            moment.append(np.zeros(3))
        if mass:
            for weight, centre in _bodies(tree, joint.child, T, on_chain):
                mass[-1] += weight
                moment[-1] = moment[-1] + weight * centre
    weights = np.array(mass)
    centres = np.array(moment) / np.where(weights > 0.0, weights, 1.0)[:, None]
    return _Chain(
        joints=tuple(moving),
        axis=np.array(axis),
        point=np.array(point),
        T_base_tip=T,
        mass=weights,
        com=centres,
    )


def _bodies(
    tree: UrdfTree, link: str, T_base_link: Array, on_chain: set[str]
) -> list[tuple[float, Array]]:
    """Mass and centre in base of a link and of all fixed to it off the chain."""
    body = tree.links[link]
    found = [(body.mass, apply(T_base_link, body.com))] if body.mass > 0.0 else []
    for joint in tree.joints:
        if joint.parent != link or joint.name in on_chain:
            continue
        carried = _bodies(tree, joint.child, T_base_link @ joint.T_parent_joint, on_chain)
        if joint.kind != "fixed" and carried:
            raise ConfigurationError(
                f"joint {joint.name!r} moves {sum(m for m, _ in carried):.3f} kg beside the chain "
                "to the tip; its gravity torque would be wrong.",
                source=tree.source,
                line=joint.line,
                hint="fix the joint, or take its masses out.",
            )
        found += carried
    return found


def _frames(chain: _Chain, tree: UrdfTree) -> tuple[Array, Array]:
    """Returns x axes and origins of all frames at zero."""
    n = len(chain.axis)
    x, origin = np.empty((n, 3)), np.empty((n, 3))
    before_x = np.eye(3)[0]
    _check_first(chain, tree)
    meets = before_x * (chain.point[0] @ before_x)  # where the x before meets this axis
    for i in range(n):
        z, p = chain.axis[i], chain.point[i]
        if i + 1 == n:
            tip = chain.T_base_tip
            origin[i] = p + z * (z @ (tip[:3, 3] - p))
            x[i] = _across(z, tip[:3, 0], tip[:3, 1])
            break
        z_next, p_next = chain.axis[i + 1], chain.point[i + 1]
        cross = np.cross(z, z_next)
        sine = float(np.linalg.norm(cross))
        if _PARALLEL < sine < _ROUNDED:
            raise ConfigurationError(
                f"axes {i + 1} and {i + 2} "
                f"({chain.joints[i].name!r}, {chain.joints[i + 1].name!r}) are parallel but for "
                f"{np.degrees(sine):.2g} deg, which looks like rounding.",
                source=tree.source,
                line=chain.joints[i + 1].line,
                hint="right_angle=1e-4, or write pi/2 with all its digits.",
            )
        if sine <= _PARALLEL:
            origin[i] = meets
            gap = p_next - meets
            gap = gap - z * (z @ gap)
            far = np.linalg.norm(gap) > _PARALLEL
            x[i] = gap / np.linalg.norm(gap) if far else _across(z, before_x, np.eye(3)[1])
            meets = meets + gap if far else meets
        else:
            normal = cross / sine
            gap = float(normal @ (p_next - p))
            flip = gap < -_PARALLEL or (abs(gap) <= _PARALLEL and normal @ before_x < 0.0)
            x[i] = -normal if flip else normal
            along = float(np.cross(p_next - p, z_next) @ normal) / sine
            origin[i] = p + z * along
            meets = origin[i] + normal * gap
        before_x = x[i]
    return x, origin


def _check_first(chain: _Chain, tree: UrdfTree) -> None:
    """A modified DH table starts along the root's x; axis 1 must cross it at a right angle."""
    z, p = chain.axis[0], chain.point[0]
    foot = p - np.eye(3)[0] * p[0]
    off_line = float(np.linalg.norm(foot - z * (z @ foot)))
    if abs(z[0]) > _PARALLEL or off_line > _PARALLEL:
        raise ConfigurationError(
            f"axis 1 ({chain.joints[0].name!r}) has direction {np.round(z, 6).tolist()} through "
            f"{np.round(p, 6).tolist()} m in link {chain.joints[0].parent!r}; a DH table needs it "
            "along the root link's z.",
            source=tree.source,
            line=chain.joints[0].line,
            hint="let the root link's z lie on joint 1, and keep the mounting in [base].",
        )


def _across(z: Array, first: Array, second: Array) -> Array:
    """Unit vector across z nearest to ``first``, or to ``second`` if that is along z."""
    for candidate in (first, second):
        flat = candidate - z * (z @ candidate)
        length = float(np.linalg.norm(flat))
        if length > 0.1:
            out: Array = flat / length
            return out
    out = np.cross(z, np.cross(first, z) + np.cross(second, z))
    return out / np.linalg.norm(out)


def _angle(start: Array, end: Array, about: Array) -> float:
    return float(np.arctan2(np.cross(start, end) @ about, start @ end))


def _clean(table: Array) -> Array:
    """Removes rounding of a few 1e-16, so that zeros and right angles read as such."""
    quarter = np.pi / 2.0
    near = np.rint(table[[0, 3]] / quarter) * quarter
    table[[0, 3]] = np.where(np.abs(table[[0, 3]] - near) < 1e-13, near, table[[0, 3]])
    table[[1, 2]] = np.where(np.abs(table[[1, 2]]) < 1e-13, 0.0, table[[1, 2]])
    return table
