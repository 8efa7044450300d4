"""What G-code moves: frames in force, the point where the tool is, lines, arcs and their targets.

Numbers are m and deg. Frames are matrices, so a control of turned work frames is one of a robot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from controllers import Arc, Ended, Move

from robotrue.core.rotations import (
    matrix_from_abc,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.program.program import FrameTable

FLAT = ((0, 1), (2, 0), (1, 2))
"""Axes of the planes G17, G18, G19."""
UPRIGHT = np.diag([1.0, -1.0, -1.0])
"""A tool frame whose z points down, from the spindle to the tip, and whose x is that of the work
frame."""
FULL, ROUND = 5e-6, 0.05 * MM
"""m between ends of a whole circle; by which the ends of an arc may miss one circle."""
Words = Mapping[str, tuple[float, bool]]
"""Value by address, and whether it is an increment."""


def shift(xyz: np.ndarray) -> np.ndarray:
    """The pose (4, 4) of a translation (3,)."""
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def turned(angles: np.ndarray) -> np.ndarray:
    """The matrix of A, B, C about X, Y, Z in deg: Rz(C) Ry(B) Rx(A)."""
    return matrix_from_abc(angles[::-1] * DEG)


def rotation(angles: np.ndarray) -> np.ndarray:
    """The pose (4, 4) of a rotation by A, B, C in deg."""
    T = np.eye(4)
    T[:3, :3] = turned(angles)
    return T


class GcodeMachine:
    """Frames, tool and point of one control.

    Args:
        table: Work frames and tools by name; those it does not know are somewhere.
        spin: Of the tool about its axis, where a program states the axis alone; rad.
    """

    def __init__(self, table: FrameTable, spin: float) -> None:
        self.frames, self.tools = dict(table.bases), dict(table.tools)
        self.frames[""], self.tools[""] = table.T_base_frame, table.T_flange_tool
        self.spin = matrix_from_abc(np.array([spin, 0.0, 0.0]))
        self.moves: list[Move] = []
        self.reset()

    def reset(self) -> None:
        """What a program begins with."""
        self.name, self.active = "", np.array(self.frames[""])
        self.shifts: dict[str, np.ndarray] = {}
        self.tool = self.tools[""]
        self.drive, self.plane, self.relative, self.unit = 0, 0, False, MM
        self.tip, self.absolute_centre = 0, False  # tip: 0 no rotary words, 1 angles, 2 an axis
        self.where, self.follow = np.zeros(3), np.zeros(3, np.bool_)
        self.turn, self.angles, self.turn_follows = UPRIGHT @ self.spin, np.full(3, np.nan), False
        self.axis = np.zeros(3)  # of the tool, where the block states one

    # Frames

    @property
    def base(self) -> np.ndarray:
        """The frame that coordinates are in."""
        out = self.active
        for kind in ("preset", "local", "program", "rotation"):
            if kind in self.shifts:
                out = out @ self.shifts[kind]
        return out

    def change(self, act: Callable[[], None]) -> None:
        """Does what changes the frame; the robot stays where it is."""
        before = self.base
        act()
        if not np.array_equal(before, self.base):
            self._see(np.linalg.inv(self.base) @ before)

    def _see(self, T: np.ndarray) -> None:
        """Where the robot is, in other coordinates."""
        self.where = T[:3, :3] @ self.where + T[:3, 3]
        if not np.allclose(T[:3, :3], np.eye(3)):
            self.follow[:] = self.follow.any()
            self.turn, self.angles = T[:3, :3] @ self.turn, np.full(3, np.nan)

    def call(self, name: str) -> None:
        """Calls a work frame."""

        def act() -> None:
            self.name, self.active = name, np.array(self._frame(name))

        self.change(act)

    def _frame(self, name: str) -> np.ndarray:
        return self.frames.setdefault(name, shift(np.array([0.1, 0.2, -0.3])))

    def set_frame(self, name: str, T: np.ndarray, *, at_once: bool) -> None:
        """Gives a work frame another value, which stays for the next run."""
        self.frames[name] = T
        if at_once and name == self.name:
            self.call(name)

    def set_shift(self, kind: str, T: np.ndarray | None) -> None:
        """Moves or turns the coordinates in one way, or no longer."""

        def act() -> None:
            self.shifts.pop(kind, None)
            if T is not None:
                self.shifts[kind] = T

        self.change(act)

    def load(self, name: str) -> None:
        """Another tool; numbers are of its tip, wherever that is."""
        self.tool = self.tools.setdefault(name, shift(np.array([0.0, 0.0, 0.123])))

    # Motions

    @property
    def _told(self) -> tuple[int, ...]:
        return ((), (0, 1, 2), (2,))[self.tip]

    def _target(self, point: np.ndarray, turn: np.ndarray) -> np.ndarray:
        T = shift(point)
        T[:3, :3] = turn
        return T

    def emit(self, step: np.ndarray | None = None, *, follows: bool = False) -> None:
        """The robot is at a target."""
        late = follows or bool(self.follow.any()) or self.turn_follows
        self.moves.append(
            Move(
                self.base, self.tool, self._target(self.where, self.turn), via=False,
                follows=late, step=np.zeros(0) if step is None else step, told=self._told,
            )
        )  # fmt: skip

    def _read(self, words: Words) -> np.ndarray:
        """Where words lead to; returns the increments."""
        step = []
        for k, name in enumerate("XYZ"):
            if name in words:
                value, counted = words[name]
                step += [value] if counted else []
                self.where[k] = counted * self.where[k] + value * self.unit
                self.follow[k] = counted
        self._read_turn(words)
        return np.array(step)

    def _read_turn(self, words: Words) -> None:
        if self.tip == 1 and any(name in words for name in "ABC"):
            if not np.isfinite(self.angles).all():  # in other axes than they were stated in
                R = self.turn
                side = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
                seen = [np.arctan2(R[2, 1], R[2, 2]), side, np.arctan2(R[1, 0], R[0, 0])]
                self.angles = np.array(seen) / DEG
            self.turn_follows &= not all(name in words for name in "ABC")
            for k, name in enumerate("ABC"):
                if name in words:
                    value, counted = words[name]
                    self.angles[k] = counted * self.angles[k] + value
                    self.turn_follows |= counted
            self.turn = turned(self.angles)
        elif self.axis.any():
            self._tilt(self.axis)
            self.axis = np.zeros(3)
        elif self.tip == 0:
            self.turn = UPRIGHT @ self.spin

    def _tilt(self, axis: np.ndarray) -> None:
        """Turns the tool to an axis (3,), from z of the frame by the smallest rotation.

        The frame is carried so along axes in one plane with z, whatever the way.
        """
        across = np.cross([0.0, 0.0, 1.0], axis / np.linalg.norm(axis))
        sine = float(np.linalg.norm(across))
        turn = across * (np.arctan2(sine, axis[2]) / sine if sine else 1.0)
        self.turn = matrix_from_rotation_vector(turn) @ UPRIGHT @ self.spin
        self.angles, self.turn_follows = np.full(3, np.nan), False

    def line(self, words: Words) -> None:
        """A straight move, rapid or not."""
        self.emit(self._read(words))

    def circle(self, words: Words, centre: Mapping[str, float], radius: float | None) -> None:
        """An arc in the plane, with its middle.

        Args:
            words: Of its end.
            centre: I, J, K, m; from the start, or absolute.
            radius: Instead of a centre, m; negative for more than half a turn.
        """
        flat = FLAT[self.plane]
        first, turn, left = self.where.copy(), self.turn, self.drive == 3
        step = self._read(words)
        one, two = first[list(flat)], self.where[list(flat)]
        if radius is None:
            base = np.zeros(2) if self.absolute_centre else one
            middle = base + np.array([centre.get("IJK"[k], 0.0) for k in flat])
        else:
            half, side = 0.5 * (two - one), 1.0 if (radius > 0) == left else -1.0
            if not 0.0 < half @ half <= radius * radius * 1.001:
                raise Ended
            high = np.sqrt(max(radius * radius / float(half @ half) - 1.0, 0.0))
            middle = one + half + side * high * np.array([-half[1], half[0]])
        self._sweep(flat, middle, first, turn, left=left)
        self.emit(step)

    def _sweep(
        self, flat: tuple[int, int], centre: np.ndarray, first: np.ndarray, turn: np.ndarray,
        *, left: bool,
    ) -> None:  # fmt: skip
        one, two = first[list(flat)] - centre, self.where[list(flat)] - centre
        radius = float(np.hypot(*one))
        if abs(radius - float(np.hypot(*two))) > ROUND or radius == 0.0:
            raise Ended
        begin, end = np.arctan2(one[1], one[0]), np.arctan2(two[1], two[0])
        sweep = (end - begin) % (2.0 * np.pi)
        if np.abs(one - two).max() < FULL:
            sweep = 2.0 * np.pi
        elif not left:
            sweep -= 2.0 * np.pi
        sweep = sweep if left or sweep < 0.0 else -sweep
        angle = begin + 0.5 * sweep
        half = 0.5 * (first + self.where)
        half[list(flat)] = centre + radius * np.array([np.cos(angle), np.sin(angle)])
        arc = Arc(flat, centre, radius, angle, 0.5 * sweep)
        self._via(half, turn, arc)

    def _via(self, point: np.ndarray, turn: np.ndarray, arc: Arc | None) -> None:
        bend = 0.5 * rotation_vector_from_matrix(turn.T @ self.turn)
        target = self._target(point, turn @ matrix_from_rotation_vector(bend))
        late = bool(self.follow.any())
        self.moves.append(
            Move(self.base, self.tool, target, via=True, follows=late, told=(), arc=arc)
        )

    def through(self, words: Words, middle: np.ndarray) -> None:
        """An arc through a point (3,) m."""
        turn = self.turn
        step = self._read(words)
        self._via(middle, turn, None)
        self.emit(step)

    def to_axes(self, axes: np.ndarray) -> None:
        """Six axes, in deg; where that is, is some function of them."""
        self.moves.append(Move(self.base, self.tool, axes * DEG, via=False))
        self.where, self.follow[:] = 0.3 * np.sin(axes[:3] * DEG), False
        self.turn, self.angles, self.turn_follows = turned(axes[3:]), np.full(3, np.nan), False

    def go_home(self, names: str, home: np.ndarray) -> None:
        """Axes of the machine go to its reference point; no target."""
        root = self.base[:3, :3] @ self.where + self.base[:3, 3]
        for name in names:
            root["XYZ".index(name)] = home["XYZ".index(name)]
        self.where = self.base[:3, :3].T @ (root - self.base[:3, 3])
        self.follow[:] = self.follow.any()

    def machine_move(self, words: Words) -> None:
        """A move in coordinates of the machine, of one block."""
        name, active, shifts = self.name, self.active, self.shifts

        def leave() -> None:
            self.active, self.shifts = np.eye(4), {}

        def back() -> None:
            self.name, self.active, self.shifts = name, active, shifts

        self.change(leave)
        self.line(words)
        self.change(back)
