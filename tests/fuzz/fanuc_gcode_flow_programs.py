"""Fanuc G-code jobs by a seed; for ``fanuc_gcode_controller``."""

from __future__ import annotations

import numpy as np
from gcode_flow_programs import GcodeFlowWriter


class FanucGcodeFlowWriter(GcodeFlowWriter):
    """Fanuc's jobs."""

    words = ("A", "B", "C")

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        pen = self.pen
        tip = {"none": "G49", "angles": "G43.4 H1", "axis": "G43.5 H1"}[self.turn]
        head = [
            "G90 G17 G21 G40 G80 G69",
            *(["T1 M6"] if self.changer else ["T1"]),
            pen.pick("G54", "G54", "G55"),
            tip,
            "#110=1.",
            "#120=25.5",
        ]
        if pen.chance(0.1):
            head.remove(tip)
        body = [*head, self.full("G0"), *self.block(2, True, pen.whole(3, 10))]
        files = {"1": [*self.numbered(body), "M99" if pen.chance(0.1) else "M30"]}
        for name in self.subs:
            begin = pen.pick("G90 G54", "", "") if pen.chance(0.5) else "G90 G17 G21 G54 G1"
            first = self.full() if pen.chance(0.5) else self.some()
            self.inch = False
            files[name] = [begin, first, *self.block(1, False, pen.whole(1, 4)), "M99"]
        texts = {
            name: [f"O{int(name):04d}", *(x for x in lines if x)] for name, lines in files.items()
        }
        if pen.chance(0.35):
            whole = [line for lines in texts.values() for line in lines]
            return {"part.nc": "\n".join(["%", *whole, "%"]) + "\n"}
        names = {name: "part.nc" if name == "1" else f"O{int(name):04d}.nc" for name in texts}
        return {names[n]: "\n".join(["%", *lines, "%"]) + "\n" for n, lines in texts.items()}

    def arcs(self) -> bool:
        """I, J, K is the tool axis of G43.5."""
        return self.turn != "axis"

    def axis(self) -> str:
        """A tool axis in the plane of X and Z."""
        tilt = float(self.pen.rng.uniform(-0.7, 0.7))
        return f"I{np.sin(tilt):.8f} J0.00000000 K{np.cos(tilt):.8f}"

    def radius(self, radius: float, digits: int) -> str:
        """The word of a radius."""
        return f"R{radius:.{digits}f}"

    def comment(self) -> str:
        """A comment."""
        return self.pen.pick("(ROUGH X1. G55)", "M8 (T2 M6)")

    def frame(self) -> str:
        """A call of a work frame."""
        return self.pen.pick(
            "G54",
            "G55",
            "G55",
            "G54.1 P1",
            "G56",
            f"G54.1 P1 {self.point('XY')}",
            f"G55 {self.point('XY')}",
        )

    def local(self) -> list[str]:
        """The zero is moved."""
        if self.pen.chance(0.1) and not self.inch:
            return [f"G92 {self.point(self.pen.pick('XYZ', 'XY', 'Z'))}"]
        place = self.pen.pick(self.point(), self.point(), self.point("XY"), "X0. Y0. Z0.")
        out = [f"G52 {place}"]
        if place != "X0. Y0. Z0." and self.pen.chance(0.7):
            out += [self.next(), self.some(), "G52 X0. Y0. Z0."]
        return out

    def rotated(self) -> list[str]:
        """Turned coordinates, and the end of that."""
        turn = f"{self.pen.rng.uniform(-90, 90):.3f}"
        lines = [self.full(), self.some()]
        return [f"G68 {self.point('XY')} R{turn}", *lines, "G69", self.full()]

    def machine(self) -> str:
        """A move in coordinates of the machine."""
        return self.pen.pick(
            f"G0 G53 {self.point(self.pen.pick('Z', 'XYZ'))}",
            "G91 G28 Z0.\nG90",
            f"G28 {self.point('Z')}",
            "G91 G28 X0. Y0. Z0.\nG90",
            "G91 G30 Z0.\nG90",
        )

    def cycle(self) -> list[str]:
        """Holes."""
        pen = self.pen
        where = self.point(pen.pick("XY", "XY", "X"))
        bottom, near = (f"{abs(float(self.place(size))):.3f}" for size in (20, 9))
        word = f"{pen.pick('G98 ', 'G99 ', '')}G8{pen.whole(1, 3)}"
        head = f"{word} {where} Z-{bottom} R{near}"
        holes = [self.point(pen.pick("XY", "X", "Y")) for _ in range(pen.whole(0, 3))]
        after = pen.pick(
            self.full("G0"), self.full("G1"), f"G0 {self.point('XY')}", f"G0 {self.point('Z')}"
        )
        return [head, *holes, *pen.pick("G80", "").split(), after]

    def variable(self) -> list[str]:
        """Computed coordinates."""
        return [
            self.pen.pick("#120=#120+1.5", f"#120={self.place()}", ""),
            self.pen.pick("X#120", "G1 Y[#120*2.] Z5.", f"G1 X-#120 {self.point('YZ')}"),
            self.some(),
        ]

    def units(self) -> str:
        """The other unit."""
        return "G20" if self.inch else "G21"

    def special(self) -> list[str]:
        """What one control has."""
        pen = self.pen
        kind = pen.whole(0, 4)
        if kind == 0:
            offset = pen.pick("L2 P1", "L2 P2", "L20 P1", "L2 P3")
            return [f"G10 {offset} {self.point()}", pen.pick(self.frame(), "G54"), self.next()]
        if kind == 1 and self.subs:
            inside = [self.full(), *self.between(), self.some()]
            return [f"G66 P{self.subs[-1]} A2.5", *inside, "G67", self.next()]
        if kind == 2:
            return ["G4 X1.5", self.some()]
        if kind == 3 and self.turn != "none":
            tip = {"angles": "G43.4 H1", "axis": "G43.5 H1"}[self.turn]
            return ["G49", tip, self.next()]
        return [f"G17 G90.1\nG91.1 {self.full('G1')}", self.some()]

    def call(self) -> list[str]:
        """A call of another program of the job, or of one that is not there."""
        name, pen = self.pen.pick(*self.subs), self.pen
        head = pen.pick(
            f"M98 P{name}",
            f"M98 P{name}",
            f"M98 P{name} L2",
            f"M98 P2{int(name):04d}",
            f"G65 P{name} A1.5 B7.",
            f"{self.point('XY')} M98 P{name}",
            "M98 P7777",
        )
        return [
            self.full() if pen.chance(0.5) else self.some(),
            head,
            self.next() if pen.chance(0.5) else f"G90 {self.frame()} {self.full()}",
        ]

    def structure(self, depth: int, main: bool) -> list[str]:
        """A loop, a branch or a jump."""
        pen, one = self.pen, self.block(depth - 1, main, 2)
        self.labels += 1
        label = 5000 + self.labels + (1000 if not main else 0)
        kind = pen.whole(0, 3)
        mark = pen.pick(f"N{label}", f"N{label} {self.full()}", f"N{label} {self.some()}")
        if kind == 0:
            return [self.jump(f"IF [#{1000 + self.labels} EQ 1] GOTO {label}"), *one, mark]
        if kind == 1:
            return [mark, *one, self.jump(f"IF [#{1000 + self.labels} NE 0] GOTO {label}")]
        if kind == 2:
            count = f"#{130 + self.labels}"
            return [
                f"{count}=0",
                f"WHILE [{count} LT 2] DO{3 - depth}",
                *one,
                f"{count}={count}+1",
                f"END{3 - depth}",
            ]
        return [
            f"IF [#{1000 + self.labels} EQ 1] THEN #120=7.5",
            self.jump(f"GOTO {label}") if pen.chance(0.3) else "M8",
            *one,
            mark,
        ]
