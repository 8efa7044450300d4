"""G-code jobs of calls, jumps, frames and cycles, by a seed.

Not written, since controls differ in what it means: numbers without a point (Fanuc), states that
the head leaves to the control, G92 beside G52 or G68, words left out behind G68, ROT and G80,
G91 in cycles, jumps out of a repeated part, SCALE and MIRROR, CYCLE800, rotary words without tool
point control, and parts of a tool axis.
"""

from __future__ import annotations

import numpy as np
from written import FRAME, Pen

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable


def _frame(*numbers: float) -> np.ndarray:
    return pose_from_xyz_abc(np.array(numbers[:3]) * MM, np.array(numbers[3:]) * DEG)


TOOLS = {"T1": _frame(10, -20, 150, 10, 0, 5), "T2": _frame(0, 30, 220, 0, 20, 0)}
GCODE_FRAMES = FrameTable(
    T_base_frame=_frame(700, 200, 100, 5, 3, -2),
    T_flange_tool=_frame(0, 0, 90, 0, 0, 0),
    bases={
        "G54": FRAME,
        "G55": _frame(600, 300, 200, -20, 5, 3),
        "G54.1 P1": _frame(500, -400, 250, 30, 0, 0),
        "G505": _frame(500, -400, 250, 30, 0, 0),
    },
    tools=TOOLS,
    orientation=OrientationRule(angles="rpy", spin=20.0 * DEG),
)


class GcodeFlowWriter:
    """What the languages share: points, arcs, states and structures."""

    words: tuple[str, str, str]
    """Addresses of the three angles."""

    def __init__(self, pen: Pen) -> None:
        self.pen, self.labels = pen, 0
        self.pen.decimals = max(pen.decimals, 4) if pen.chance(0.5) else pen.decimals
        self.calm = pen.chance(0.6)
        self.turn = pen.pick("none", "none", "angles", "angles", "axis")
        self.subs = [str(100 * k) for k in range(1, pen.whole(0, 2) + 1)]
        self.presets = self.changer = pen.chance(0.5)
        self.inch = False

    # Numbers and points

    def place(self, size: float = 300.0) -> str:
        """A coordinate with a point."""
        size, digits = (
            (size / 25.0, self.pen.decimals + 1) if self.inch else (size, self.pen.decimals)
        )
        text = self.pen.number(size, digits)
        return text if "." in text else text + "."

    def value(self, name: str, text: str) -> str:
        """A word."""
        return name + text

    def point(self, names: str = "XYZ") -> str:
        """Coordinates."""
        return " ".join(self.value(name, self.place()) for name in names)

    def angles(self, names: tuple[str, ...]) -> str:
        """Angles of the tool."""
        return " ".join(
            name + f"{self.pen.rng.uniform(-70, 70):.{self.pen.turns}f}" for name in names
        )

    def axis(self) -> str:
        """A tool axis in the plane of X and Z."""
        raise NotImplementedError

    def attitude(self, *, full: bool) -> str:
        """Words of the attitude, or none."""
        if self.turn == "none" or (not full and self.pen.chance(0.6)):
            return ""
        if self.turn == "axis":
            return " " + self.axis()
        some = tuple(name for name in self.words if full or self.pen.chance(0.6))
        return " " + self.angles(some) if some else ""

    def full(self, word: str = "") -> str:
        """A block with all words of a point."""
        return f"{word or self.pen.pick('G0', 'G1', 'G1')} {self.point()}{self.attitude(full=True)}"

    def some(self) -> str:
        """A block with a part of them."""
        names = self.pen.pick("X", "Y", "Z", "XY", "XZ", "XYZ", "XYZ", "Z", "XY")
        return (
            f"{self.pen.pick('G0 ', 'G1 ', '', '')}{self.point(names)}{self.attitude(full=False)}"
        )

    def next(self) -> str:
        """A block behind something that changes the meaning of coordinates."""
        return (
            self.full()
            if self.pen.chance(0.75)
            else "G1 " + self.some().replace("G0 ", "").replace("G1 ", "")
        )

    def arc(self) -> list[str]:
        """A line to the start of an arc, and one or two of them."""
        pen, unit = self.pen, 1.0 / 25.4 if self.inch else 1.0
        plane = pen.pick("G17", "G17", "G18", "G19")
        names = {"G17": "XYZ", "G18": "ZXY", "G19": "YZX"}[plane]
        centres = {"G17": "IJ", "G18": "KI", "G19": "JK"}[plane]
        digits = pen.decimals + (2 if self.inch else 1)
        out = [f"{plane} {self.full('G1')}"]
        start = {n: float(t) for n, t in zip("XYZ", self._numbers(out[0]), strict=True)}
        for _ in range(pen.whole(1, 2)):
            radius, begin = float(pen.rng.uniform(40, 200)) * unit, float(pen.rng.uniform(-3, 3))
            middle = [
                round(start[names[k]] - radius * f(begin), digits)
                for k, f in enumerate((np.cos, np.sin))
            ]
            away = [start[names[k]] - middle[k] for k in (0, 1)]
            radius, begin = float(np.hypot(*away)), float(np.arctan2(away[1], away[0]))
            left, sweep = pen.chance(0.5), float(pen.rng.uniform(0.3, 5.5))
            angle = begin + (sweep if left else -sweep)
            end = [middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)]
            line = f"{'G3' if left else 'G2'} "
            for k in (0, 1):
                start[names[k]] = round(end[k], digits)
                line += self.value(names[k], f"{start[names[k]]:.{digits}f}") + " "
            if pen.chance(0.3):
                start[names[2]] = float(self.place())
                line += self.value(names[2], f"{start[names[2]]:.{digits}f}") + " "
            if pen.chance(0.7):
                line += " ".join(f"{c}{-away[k]:.{digits}f}" for k, c in enumerate(centres))
            else:
                line += self.radius(radius if sweep < np.pi else -radius, digits)
            out.append(line + self.attitude(full=False) * (self.turn != "axis"))
        if pen.chance(0.2) and " R" not in out[-1] and "CR" not in out[-1]:
            out.append(f"G2 {centres[0]}{self.place(90)} {centres[1]}{self.place(90)}")
        return [
            *out,
            pen.pick(
                f"G17 {self.full('G1')}", f"G17 {self.full('G1')}", f"G17 G1 {self.point('XY')}"
            ),
        ]

    @staticmethod
    def _numbers(line: str) -> list[str]:
        fields = {field[0]: field[1:].lstrip("=") for field in line.split()}
        return [fields[name] for name in "XYZ"]

    def radius(self, radius: float, digits: int) -> str:
        """The word of a radius."""
        raise NotImplementedError

    # Blocks

    def block(self, depth: int, main: bool, size: int = 0) -> list[str]:
        """Some statements."""
        count = size or self.pen.whole(1, 4)
        return [line for _ in range(count) for line in self.statement(depth, main)]

    def statement(self, depth: int, main: bool) -> list[str]:
        """One statement, in some blocks."""
        pen, kind = self.pen, self.pen.whole(0, 35)
        if self.calm and kind >= 14 and pen.chance(0.5):
            kind = pen.whole(0, 13)
        if kind <= 9:
            return [self.full() if pen.chance(0.4) else self.some()]
        if kind <= 11:
            return self.arc() if self.arcs() else [self.full()]
        if kind <= 13:
            return [pen.pick("M8", self.comment(), "S1000 M3", ""), self.some()]
        if kind <= 15:
            return [self.frame(), self.next()]
        if kind == 16:
            return self.counted()
        if kind == 17:
            return ["/" + pen.pick("", "2 ") + self.skippable(main), self.next()]
        if kind == 18:
            return self.tool()
        if kind <= 20:
            return [*self.local(), self.next()]
        if kind == 21:
            return self.rotated()
        if kind == 22:
            return [self.machine(), self.next()]
        if kind <= 24:
            return self.cycle()
        if kind == 25:
            return self.variable()
        if kind == 26 and not depth - 2 and main:
            self.inch = not self.inch
            return [self.units(), self.next()]
        if kind == 27:
            return self.special()
        if kind <= 30 and self.subs and main:
            return self.call()
        if not depth:
            return [self.some()]
        return self.structure(depth, main)

    def arcs(self) -> bool:
        """Whether arcs can be told from other words."""
        return True

    def counted(self) -> list[str]:
        """Increments."""
        return [
            f"G91 G1 {self.point(self.pen.pick('X', 'XY', 'Z'))}",
            *([self.some()] if self.pen.chance(0.3) else []),
            f"G90 {self.next()}",
        ]

    def skippable(self, main: bool) -> str:
        """A block that a switch skips."""
        pen = self.pen
        blocks = [self.full(), self.some(), self.frame(), "M8"]
        if pen.chance(0.5):
            blocks = [self.tool()[0], self.local()[0], self.rotated()[0]]
            blocks += [self.call()[1]] * 2 if self.subs and main else []
        return pen.pick(*blocks)

    def between(self) -> list[str]:
        """What changes between points behind which a program runs, if anything."""
        if self.pen.chance(0.6):
            return []
        return [self.pen.pick(self.frame(), self.local()[0], self.tool()[0], "G0"), self.full()]

    def jump(self, text: str) -> str:
        """A jump, now and then one that a switch skips."""
        return f"/{text}" if self.pen.chance(0.15) else text

    def tool(self) -> list[str]:
        """A tool is chosen, and loaded now or later."""
        chosen = self.pen.pick("T1", "T2")
        if not self.changer:
            return [chosen, self.next()]
        if self.pen.chance(0.4):
            return [chosen, self.some()]
        return [self.pen.pick(f"{chosen} M6", "M6"), self.next()]

    def numbered(self, lines: list[str]) -> list[str]:
        """Blocks with numbers, now and then."""
        if not self.pen.chance(0.3):
            return lines
        return [
            f"N{10 * (k + 1)} {line}"
            if line and line[0] not in "N%O(;/" and ":" not in line
            else line
            for k, line in enumerate(lines)
        ]

    def comment(self) -> str:
        """A comment."""
        raise NotImplementedError

    def frame(self) -> str:
        """A call of a work frame."""
        raise NotImplementedError

    def local(self) -> list[str]:
        """The zero is moved."""
        raise NotImplementedError

    def rotated(self) -> list[str]:
        """Turned coordinates, and the end of that."""
        raise NotImplementedError

    def machine(self) -> str:
        """A move in coordinates of the machine."""
        raise NotImplementedError

    def cycle(self) -> list[str]:
        """Holes."""
        raise NotImplementedError

    def variable(self) -> list[str]:
        """Computed coordinates."""
        raise NotImplementedError

    def units(self) -> str:
        """The other unit."""
        raise NotImplementedError

    def special(self) -> list[str]:
        """What one control has."""
        raise NotImplementedError

    def call(self) -> list[str]:
        """A call of another program of the job."""
        raise NotImplementedError

    def structure(self, depth: int, main: bool) -> list[str]:
        """A loop, a branch or a jump."""
        raise NotImplementedError
