"""A finished part inside its blank: the allowance on every touched face, and the smallest.

The blank is given by its touched faces: planes in the part's coordinates, in the frame used for
cutting. Untouched sides, such as the bottom, bound nothing. Where two faces look opposite ways a
shift can share what is left between them; where that is not enough and a turn about the axis that
the setting-up leaves free gives surely more, the part turns, too.

That axis keeps what was not touched where it is: the side the part lies on stays parallel to
itself, and no face turns that nothing is known opposite of. With turn w and shift s, small, a
vertex v of the part stays inside a face (normal n, offset d) by

    d - n.v - n.s - w.(v x n) >= t,

a linear program in s, w and the least allowance t, solved again about the turned part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from scipy.optimize import linprog

from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.poses import apply, inverse
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.surfaces import TriangleMesh
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, ImplausibleDataError, ObservabilityError
from robotrue.measurement.probing_set import ProbingSet
from robotrue.validation.registration_methods import group_faces
from robotrue.validation.touch_checks import file_of

LARGEST: Final = 5.0 * DEG
"""rad; a blank that lies farther off is to be set up again."""
STEPS: Final = 3
ALIKE: Final = 0.35
"""Sine below which a normal counts as along an axis."""
NEAREST: Final = 64
"""Vertices of the part kept for each face: those nearest to it."""


def turning_axes(paired: Array, alone: Array) -> Array:
    """Returns the axes (r, 3) a part may turn about, in the part.

    Args:
        paired: (p, 3) one normal of each pair of opposite touched faces.
        alone: (q, 3) normals of touched faces with nothing touched opposite.
    """
    if not len(paired):
        return np.empty((0, 3))
    _, size, rows = np.linalg.svd(paired)
    rank = int(np.count_nonzero(size > ALIKE * size[0]))
    if rank < 2:
        return np.empty((0, 3))
    axes = np.eye(3) if rank == 3 else rows[2:]
    for normal in alone:  # only the turn about its own normal leaves such a face alike
        axes = axes[np.linalg.norm(np.cross(axes, normal), axis=1) < ALIKE]
    return np.asarray(axes)


def best_turn(vertices: Array, normals: Array, offsets: Array, axes: Array, shifts: Array) -> Array:
    """Returns the rotation vector (3,) rad of the part in itself that leaves most.

    Args:
        vertices: (v, 3) m of the part.
        normals: (f, 3) of the blank's faces, outward, in the part.
        offsets: (f,) m, points p of a face have ``normal @ p = offset``.
        axes: (r, 3) it may turn about.
        shifts: (k, 3) directions it may move along.
    """
    turn = np.zeros(3)
    for _ in range(STEPS):
        turned = vertices @ matrix_from_rotation_vector(turn).T
        rows, room = [], []
        for normal, offset in zip(normals, offsets, strict=True):
            depth = turned @ normal
            near = turned[np.argsort(-depth)[:NEAREST]]
            moment = np.cross(near, normal)
            one = np.ones((len(near), 1))
            rows.append(np.hstack([one * (shifts @ normal), moment @ axes.T, one]))
            room.append(offset - near @ normal)
        count = len(shifts) + len(axes)
        limit = [(None, None)] * len(shifts) + [(-LARGEST, LARGEST)] * len(axes) + [(None, None)]
        found = linprog(
            np.append(np.zeros(count), -1.0),
            A_ub=np.vstack(rows),
            b_ub=np.concatenate(room),
            bounds=limit,
        )
        if found.status != 0 or found.x is None:
            return np.zeros(3)
        turn = turn + found.x[len(shifts) : count] @ axes
    return np.asarray(np.zeros(3) if np.linalg.norm(turn) > LARGEST else turn)


def turned_allowances(
    vertices: Array, normals: Sequence[Array], offsets: Array, turn: Array
) -> Array:
    """Returns the allowance (f,) m of every face over the part turned in itself."""
    turned = vertices @ matrix_from_rotation_vector(turn).T
    return np.asarray(offsets - (turned @ np.asarray(normals).T).max(axis=0))


BlankVerdict: TypeAlias = Literal[
    "fits", "fits when shifted", "fits when turned", "undecided", "does not fit"
]
OPPOSITE: Final = 20.0 * DEG
"""Faces whose normals are this near to opposite share what is left."""
TILT: Final = 20.0 * DEG
"""Largest angle between a face as touched and its nominal normal."""
NARROW: Final = 0.05
"""Touches of a face whose smaller spread is below this part of the larger give no tilt."""
ALONG: Final = 0.9
"""Cosine above which a turn about an axis leaves a face as it is."""
SIGMAS: Final = 2.0
"""Standard deviations of "undecided"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlankFace(Columns):
    """One touched face of the blank, and what the part leaves there.

    Attributes:
        name: Of its first touch.
        normal: (3,) unit vector in part, out of the blank.
        offset: m; points p of the face have ``normal @ p = offset``.
        touches: How many.
        flat: m, largest distance of a touch from the plane.
        corner: (3,) m, the point of the part nearest to the face or furthest out of it.
        allowance: m, the blank over the part there; negative: the part sticks out.
        known: m, standard deviation of ``allowance``.
        tilted: Whether its tilt was touched; else it is the drawing's.
    """

    name: str
    normal: Annotated[Array, Column("3")]
    offset: float
    touches: int
    flat: float
    corner: Annotated[Array, Column("3", unit="m")]
    allowance: float
    known: float
    tilted: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class BlankCheck(Columns):
    """A part in its blank.

    Attributes:
        faces: Touched ones.
        required: m, required allowance everywhere.
        verdict: Of :data:`BlankVerdict`.
        shift: (3,) m in part, required shift of the part inside the blank; 0 where no two faces are
            opposite.
        turn: (3,) rad, rotation vector in part to apply before that shift; 0 where a shift is
            enough, or no turn surely leaves more.
        after: (f,) m, allowance of each face after turn and shift.
        doubts: What the touches do not determine, one sentence each.
    """

    faces: tuple[BlankFace, ...]
    required: float
    verdict: BlankVerdict
    shift: Annotated[Array, Column("3", unit="m")]
    turn: Annotated[Array, Column("3", unit="rad")]
    after: Annotated[Array, Column("f", unit="m")]
    doubts: tuple[str, ...]

    @property
    def least(self) -> BlankFace:
        """The face with the smallest allowance."""
        return min(self.faces, key=lambda face: face.allowance)


def check_blank(
    mesh: TriangleMesh,
    touches: ProbingSet,
    in_base: Array,
    T_base_part: Array,
    *,
    sigma: float,
    required: float,
) -> BlankCheck:
    """Returns what a blank leaves over a part.

    Args:
        mesh: The finished part.
        touches: Of the blank, each with the outward normal of its face in part.
        in_base: (n, 3) m, where the tip, or the centre of the ball, was.
        T_base_part: (4, 4) the frame the part will be cut in.
        sigma: m along the normal of one touch, the arm's share included.
        required: m, required allowance everywhere.

    Raises:
        ConfigurationError: A touch without a normal, or a negative allowance.
        ObservabilityError: No touch.
        ImplausibleDataError: A face that is tilted far from its normal, or exchanged faces.
    """
    if not required >= 0.0:
        raise ConfigurationError(f"allowance {required / MM:g} mm, expected 0 or more.")
    if not len(touches):
        raise ObservabilityError("no touch of the blank.")
    if touches.full.any():
        row = int(np.argmax(touches.full))
        raise ConfigurationError(
            f"{touches.labels[row]} has no normal: the face of the blank is not stated.",
            source=file_of(touches),
            line=int(touches.lines[row]) if len(touches.lines) else None,
            hint="nx,ny,nz: the face's outward normal in the part, e.g. 0,0,1.",
        )
    inside = apply(inverse(T_base_part), in_base) - touches.radius * touches.normal
    faces = tuple(
        _measure_face(mesh, touches, inside, rows, sigma) for rows in group_faces(touches)
    )
    _check_thickness(faces, touches)
    now = np.array([face.allowance for face in faces])
    turn, shift = np.zeros(3), _balance(faces, now)
    after = _shift_faces(faces, now, shift)
    slack = SIGMAS * np.array([face.known for face in faces])
    if (after - slack < required).any():
        turn = _find_turn(mesh, faces)
        turned = turned_allowances(
            mesh.vertices, [f.normal for f in faces], np.array([f.offset for f in faces]), turn
        )
        moved = _balance(faces, turned)
        better = _shift_faces(faces, turned, moved)
        if better.min() > after.min() + slack.max():
            shift, after = moved, better
        else:
            turn = np.zeros(3)
    return BlankCheck(
        faces=faces,
        required=required,
        verdict=_verdict(faces, after, required, turn),
        shift=shift,
        turn=turn,
        after=after,
        doubts=tuple(_warnings(faces)),
    )


def _measure_face(
    mesh: TriangleMesh, touches: ProbingSet, inside: Array, rows: IntArray, sigma: float
) -> BlankFace:
    """The plane through the touches of one face, and the part's point nearest to it."""
    points, nominal = inside[rows], touches.normal[rows].mean(axis=0)
    nominal = nominal / np.linalg.norm(nominal)
    middle = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - middle, full_matrices=True)
    tilted = len(rows) >= 3 and spread[1] > NARROW * spread[0] and spread[0] > MM
    normal = nominal
    if tilted:
        normal = axes[2] if axes[2] @ nominal > 0.0 else -axes[2]
        _check_tilt(float(np.arccos(np.clip(normal @ nominal, -1.0, 1.0))), touches, rows)
    off = (points - middle) @ normal
    corner = mesh.vertices[int(np.argmax(mesh.vertices @ normal))]
    across = np.stack([axes[0], axes[1]]) if tilted else np.empty((0, 3))
    design = np.column_stack([np.ones(len(rows)), (points - middle) @ across.T])
    at = np.concatenate([[1.0], across @ (corner - middle)])
    spare = len(rows) - len(at)
    scatter = float(np.sqrt((off**2).sum() / spare)) if spare > 0 else 0.0
    known = max(sigma, scatter) * np.sqrt(at @ np.linalg.solve(design.T @ design, at))
    return BlankFace(
        name=touches.names[int(rows[0])],
        normal=normal,
        offset=float(normal @ middle),
        touches=len(rows),
        flat=float(np.abs(off).max()),
        corner=corner,
        allowance=float(normal @ (middle - corner)),
        known=float(known),
        tilted=tilted,
    )


def _check_tilt(angle: float, touches: ProbingSet, rows: IntArray) -> None:
    if angle > TILT:
        names = ", ".join(touches.labels[i] for i in rows)
        raise ImplausibleDataError(
            f"touches {names} lie in a plane {angle / DEG:.0f} deg from the normal stated for "
            f"them, allowed {TILT / DEG:.0f} deg.",
            source=file_of(touches),
            line=int(touches.lines[rows[0]]) if len(touches.lines) else None,
            hint="a touch of another face, an exchanged normal, or another part frame.",
        )


def _pairs(faces: Sequence[BlankFace]) -> list[tuple[BlankFace, BlankFace]]:
    """Faces that look opposite ways."""
    return [
        (one, other)
        for i, one in enumerate(faces)
        for other in faces[i + 1 :]
        if one.normal @ other.normal < -np.cos(OPPOSITE)
    ]


def _check_thickness(faces: Sequence[BlankFace], touches: ProbingSet) -> None:
    for one, other in _pairs(faces):
        thick = one.offset + other.offset
        if thick <= 0.0:
            raise ImplausibleDataError(
                f"between {one.name} and {other.name} the blank would be {thick / MM:.1f} mm "
                "thick: the two faces are exchanged, or their normals look inward.",
                source=file_of(touches),
                hint="nx, ny, nz look out of the blank.",
            )


def _find_turn(mesh: TriangleMesh, faces: Sequence[BlankFace]) -> Array:
    """(3,) rad; 0 where nothing may turn, or a face that would turn has no touched tilt."""
    pairs = _pairs(faces)
    alone = [f for f in faces if not any(f in pair for pair in pairs)]
    paired = np.array([one.normal for one, _ in pairs]).reshape(-1, 3)
    axes = turning_axes(paired, np.array([f.normal for f in alone]).reshape(-1, 3))
    known = [axis for axis in axes if all(f.tilted or abs(f.normal @ axis) > ALONG for f in faces)]
    if not known:
        return np.zeros(3)
    bound = [f for f in faces if any(f in pair for pair in pairs)]
    return best_turn(
        mesh.vertices,
        np.array([f.normal for f in bound]),
        np.array([f.offset for f in bound]),
        np.array(known),
        np.linalg.svd(paired, full_matrices=False)[2],
    )


def _shift_faces(faces: Sequence[BlankFace], allowances: Array, shift: Array) -> Array:
    """(f,) m, what a shift leaves."""
    return np.array(
        [left - face.normal @ shift for face, left in zip(faces, allowances, strict=True)]
    )


def _balance(faces: Sequence[BlankFace], allowances: Array) -> Array:
    """The shift (3,) that leaves alike on opposite faces, and none where a face has no opposite."""
    pairs = _pairs(faces)
    if not pairs:
        return np.zeros(3)
    left = {id(face): allowance for face, allowance in zip(faces, allowances, strict=True)}
    rows = np.array([one.normal - other.normal for one, other in pairs])
    apart = np.array([left[id(one)] - left[id(other)] for one, other in pairs])
    return np.asarray(np.linalg.lstsq(rows, apart, rcond=1e-6)[0])


def _verdict(
    faces: Sequence[BlankFace], after: Array, required: float, turn: Array
) -> BlankVerdict:
    now = np.array([face.allowance for face in faces])
    slack = SIGMAS * np.array([face.known for face in faces])
    if (now - slack >= required).all():
        return "fits"
    if (after - slack >= required).all():
        return "fits when turned" if turn.any() else "fits when shifted"
    if (after + slack >= required).all() or (now + slack >= required).all():
        return "undecided"
    return "does not fit"


def _warnings(faces: Sequence[BlankFace]) -> list[str]:
    out = []
    flat = [face for face in faces if not face.tilted]
    if flat:
        out.append(
            f"Tilt of {', '.join(face.name for face in flat)} from the drawing: three touches "
            "spread over the face determine it."
        )
    alone = [f for f in faces if not any(f in pair for pair in _pairs(faces))]
    if alone:
        out.append(
            f"No touches opposite {', '.join(face.name for face in alone)}: the allowance there "
            "is unknown, and the part is not shifted in that direction."
        )
    return out
