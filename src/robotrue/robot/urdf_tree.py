"""A URDF file as links and joints that remember their line. No kinematics here.

Parsed with the standard library's expat; a document type declaration is refused before anything
in it is expanded, so an entity bomb does not go off.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.files import read_bytes
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.errors import FormatError


@dataclass(slots=True, kw_only=True)
class Node:
    """One XML element."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Node] = field(default_factory=list)

    def first(self, tag: str) -> Node | None:
        """Returns the first child of that tag, if any."""
        return next((child for child in self.children if child.tag == tag), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfLink:
    """One link: its mass in kg and centre of mass (3,) m in its own frame."""

    name: str
    line: int
    mass: float
    com: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfJoint:
    """One joint.

    Attributes:
        name: As written.
        kind: ``"fixed"``, ``"revolute"``, ``"continuous"``, ``"prismatic"``, ...
        parent: Link before it.
        child: Link after it.
        T_parent_joint: (4, 4), the ``origin``.
        axis: (3,) unit axis in the joint frame.
        limits: (2,) rad; +-360 deg for a continuous joint.
        mimic: Whether it follows another joint.
        line: Its place.
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Array
    axis: Array
    limits: Array
    mimic: bool
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class UrdfTree:
    """All links and joints of one robot."""

    name: str
    source: str
    links: dict[str, UrdfLink]
    joints: tuple[UrdfJoint, ...]


def read_tree(path: str | Path, *, right_angle: float = 0.0, data: bytes | None = None) -> UrdfTree:
    """Returns the links and joints of a URDF file.

    Args:
        path: The file.
        data: Its content; None: read from the path.
        right_angle: rad; an ``rpy`` angle this near to a multiple of 90 deg is taken as exact.

    Raises:
        FormatError: Not XML, xacro, a document type declaration, or a joint or link that is
            incomplete; with the line.
    """
    source = str(path)
    root = _parse(read_bytes(path) if data is None else data, source)
    if root.tag != "robot":
        raise FormatError(
            f"root element <{root.tag}>, expected <robot>.",
            source=source,
            line=root.line,
            hint="give a URDF file; turn SDF or MJCF into URDF first.",
        )
    links = [_link(node, source) for node in root.children if node.tag == "link"]
    joints = [_joint(node, source, right_angle) for node in root.children if node.tag == "joint"]
    names = {link.name: link for link in links}
    if len(names) != len(links):
        raise FormatError("two links have the same name.", source=source)
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in names:
                raise FormatError(
                    f"joint {joint.name!r} names link {end!r}, which does not exist.",
                    source=source,
                    line=joint.line,
                )
    return UrdfTree(
        name=root.attributes.get("name", Path(source).stem),
        source=source,
        links=names,
        joints=tuple(joints),
    )


def _parse(data: bytes, source: str) -> Node:
    parser = expat.ParserCreate()
    top = Node(tag="", attributes={}, line=0)
    stack = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        node = Node(tag=tag, attributes=attributes, line=parser.CurrentLineNumber)
        if tag.startswith("xacro:") or any("${" in value for value in attributes.values()):
            raise FormatError(
                "this is a xacro file, not URDF.",
                source=source,
                line=node.line,
                hint="expand it first: xacro robot.xacro > robot.urdf.",
            )
        stack[-1].children.append(node)
        stack.append(node)

    def end(_tag: str) -> None:
        stack.pop()

    def doctype(*_: object) -> None:
        raise FormatError(
            "a document type declaration, which URDF does not have.",
            source=source,
            line=parser.CurrentLineNumber,
            hint="delete the <!DOCTYPE ...> part.",
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as cause:
        raise FormatError(
            f"not well-formed XML: {expat.errors.messages[cause.code]}.",
            source=source,
            line=cause.lineno,
            hint="check that the file is complete.",
        ) from cause
    return top.children[0]


def _numbers(node: Node | None, key: str, default: str, source: str) -> Array:
    text = default if node is None else node.attributes.get(key, default)
    count = len(default.split())
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise FormatError(
            f"{key}={text!r}, expected {count} finite number(s).",
            source=source,
            line=None if node is None else node.line,
        )
    return values


def _origin(node: Node | None, source: str, right_angle: float) -> Array:
    xyz = _numbers(node, "xyz", "0 0 0", source)
    rpy = _numbers(node, "rpy", "0 0 0", source)
    quarter = np.rint(rpy / (np.pi / 2.0)) * (np.pi / 2.0)
    rpy = np.where(np.abs(rpy - quarter) <= right_angle, quarter, rpy)
    return pose_from_xyz_abc(xyz, rpy[::-1])


def _link(node: Node, source: str) -> UrdfLink:
    inertial = node.first("inertial")
    mass, com = 0.0, np.zeros(3)
    if inertial is not None:
        mass = float(_numbers(inertial.first("mass"), "value", "0", source)[0])
        com = _numbers(inertial.first("origin"), "xyz", "0 0 0", source)
    if mass < 0.0:
        raise FormatError(f"mass {mass} kg, expected zero or more.", source=source, line=node.line)
    return UrdfLink(name=_word(node, "name", source), line=node.line, mass=mass, com=com)


def _joint(node: Node, source: str, right_angle: float) -> UrdfJoint:
    name, kind = _word(node, "name", source), _word(node, "type", source)
    parent, child = node.first("parent"), node.first("child")
    if parent is None or child is None:
        raise FormatError(f"joint {name!r} without parent or child.", source=source, line=node.line)
    axis = _numbers(node.first("axis"), "xyz", "1 0 0", source)
    length = float(np.linalg.norm(axis))
    if kind != "fixed" and length < 1e-6:
        raise FormatError(f"joint {name!r} has a zero axis.", source=source, line=node.line)
    limits = np.array([-2.0 * np.pi, 2.0 * np.pi])
    if kind == "revolute":
        limits = _limits(node, name, source)
    return UrdfJoint(
        name=name,
        kind=kind,
        parent=_word(parent, "link", source),
        child=_word(child, "link", source),
        T_parent_joint=_origin(node.first("origin"), source, right_angle),
        axis=axis / length if length else axis,
        limits=limits,
        mimic=node.first("mimic") is not None,
        line=node.line,
    )


def _limits(node: Node, name: str, source: str) -> Array:
    limit = node.first("limit")
    if limit is None:
        raise FormatError(
            f"revolute joint {name!r} without limit.",
            source=source,
            line=node.line,
            hint='add <limit lower= upper=/>, or make it type="continuous".',
        )
    low = _numbers(limit, "lower", "0", source)[0]
    high = _numbers(limit, "upper", "0", source)[0]
    if low >= high:
        raise FormatError(
            f"joint {name!r} may move from {low} to {high} rad, expected lower below upper.",
            source=source,
            line=limit.line,
        )
    return np.array([low, high])


def _word(node: Node, key: str, source: str) -> str:
    try:
        return node.attributes[key]
    except KeyError:
        raise FormatError(f"<{node.tag}> without {key!r}.", source=source, line=node.line) from None
