"""Siemens G-code jobs by a seed; for ``sinumerik_controller``."""

from __future__ import annotations

import numpy as np
from gcode_flow_programs import GcodeFlowWriter


class SinumerikFlowWriter(GcodeFlowWriter):
    """Siemens' jobs."""

    words = ("A=", "B=", "C=")

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        pen = self.pen
        self.names: dict[str, str] = {}
        head = [
            "G90 G17 G710 G40",
            *(["T1 M6"] if self.changer else ["T1 D1"]),
            pen.pick("G54", "G54", "G55", "G500"),
            *([] if self.turn == "none" else ["TRAORI"]),
            "R1=0",
            "R2=25.5",
        ]
        body = [*head, self.full("G0"), *self.block(2, True, pen.whole(3, 10))]
        files = {"part.mpf": [*self.numbered(body), "M30"]}
        for name in self.subs:
            own = f"SUB{name}" if pen.chance(0.6) else f"L{name}"
            self.names[name] = own
            begin = pen.pick("G90 G54", "", "") if pen.chance(0.5) else "G90 G17 G710 G54 G1"
            first = self.full() if pen.chance(0.5) else self.some()
            proc = [f"PROC {own}{pen.pick('', ' SAVE', ' DISPLOF')}"] if pen.chance(0.5) else []
            self.inch = False
            files[f"{own}.spf"] = [
                *proc,
                begin,
                first,
                *self.block(1, False, pen.whole(1, 4)),
                pen.pick("M17", "RET", "M17"),
            ]
        out = {}
        for name, lines in files.items():
            text = "\n".join(line for line in lines if line) + "\n"
            for number in self.subs:
                text = text.replace(f"@{number}", self.names[number])
            out[name] = text
        return out

    def value(self, name: str, text: str) -> str:
        """A word."""
        return self.pen.pick(name, name, name, name + "=") + text

    def axis(self) -> str:
        """A tool axis in the plane of X and Z."""
        tilt = float(self.pen.rng.uniform(-0.7, 0.7))
        return f"A3={np.sin(tilt):.8f} B3=0.00000000 C3={np.cos(tilt):.8f}"

    def radius(self, radius: float, digits: int) -> str:
        """The word of a radius."""
        return f"CR={radius:.{digits}f}"

    def comment(self) -> str:
        """A comment."""
        return self.pen.pick("; rough X1 G55", "M8 ; T2 M6", 'MSG("X1")')

    def frame(self) -> str:
        """A call of a work frame."""
        return self.pen.pick("G54", "G55", "G55", "G505", "G56", "G500", f"G55 {self.point('XY')}")

    def local(self) -> list[str]:
        """The zero is moved."""
        out = [f"TRANS {self.point(self.pen.pick('XYZ', 'XY', 'Z'))}"]
        if self.pen.chance(0.3):
            out += [self.next(), f"ATRANS {self.point('X')}"]
        return [*out, self.next(), self.some(), "TRANS"] if self.pen.chance(0.8) else out

    def rotated(self) -> list[str]:
        """Turned coordinates, and the end of that."""
        turn = f"{self.pen.rng.uniform(-90, 90):.3f}"
        lines = [self.full(), self.some()]
        begin = self.pen.pick(
            f"ROT Z={turn}", f"ROT RPL={turn}", f"TRANS {self.point('XY')}\nAROT Z{turn}"
        )
        return [*begin.split("\n"), *lines, self.pen.pick("ROT", "TRANS"), self.full()]

    def machine(self) -> str:
        """A move in coordinates of the machine."""
        word = self.pen.pick("G53", "SUPA", "G153")
        return f"G0 {word} {self.point(self.pen.pick('Z', 'XYZ'))}"

    def cycle(self) -> list[str]:
        """Holes."""
        pen = self.pen
        numbers = f"(50,0,2,-{pen.whole(3, 20)})"
        holes = [self.point(pen.pick("XY", "X", "XYZ")) for _ in range(pen.whole(1, 3))]
        after = pen.pick(
            self.full("G0"), self.full("G1"), f"G0 {self.point('XY')}", f"G0 {self.point('Z')}"
        )
        if pen.chance(0.4):
            return [self.some(), f"CYCLE81{numbers}", after]
        what = pen.pick(
            f"CYCLE81{numbers}", f"@{self.subs[-1]}" if self.subs else f"CYCLE81{numbers}"
        )
        return [f"MCALL {what}", *self.between(), *holes, "MCALL", after]

    def variable(self) -> list[str]:
        """Computed coordinates."""
        return [
            self.pen.pick("R2=R2+1.5", f"R2={self.place()}", ""),
            self.pen.pick(
                "X=R2",
                "G1 Y=R2*2 Z5",
                f"G1 X=-R2 {self.point('YZ')}",
                f"G1 X=IC({self.place()})",
                f"G1 Y=AC({self.place()}) X=IC(5)",
                f"G1 X=AC({self.place()}) {self.point('YZ')}",
            ),
            self.some(),
        ]

    def units(self) -> str:
        """The other unit."""
        return "G700" if self.inch else "G710"

    def special(self) -> list[str]:
        """What one control has."""
        pen, kind = self.pen, self.pen.whole(0, 4)
        if kind == 0:
            return [self.zero(), pen.pick(self.frame(), "G54"), self.next()]
        if kind == 1 and self.turn != "none":
            return ["TRAFOOF", "TRAORI", self.next()]
        if kind == 2:
            point = " ".join(f"{n}1={self.place()}" for n in "IJK")
            return [self.full(), f"CIP {self.point()} {point}", self.full("G1")]
        if kind == 3:
            axes = " ".join(f"JT{k}={pen.rng.uniform(-90, 90):.3f}" for k in range(1, 7))
            return [f"G0 {axes}", self.next()]
        return (
            [self.full(), f"G2 {self.point('XY')} I=AC({self.place()})", self.full("G1")]
            if pen.chance(0.1)
            else ["STOPRE", self.some()]
        )

    def zero(self) -> str:
        """A work frame is set."""
        numbers = [f"{self.pen.rng.uniform(-40, 40):.2f}" for _ in range(4)]
        turn = f":CROT(Z,{numbers[3]})" if self.pen.chance(0.6) else ""
        frame = self.pen.pick("1", "2", "5")
        return f"$P_UIFR[{frame}]=CTRANS(X,{numbers[0]},Y,{numbers[1]},Z,{numbers[2]}){turn}"

    def call(self) -> list[str]:
        """A call of another program of the job, or of one that is not there."""
        name, pen = self.pen.pick(*self.subs), self.pen
        head = pen.pick(f"@{name}", f"@{name}", f"@{name} P2", f'CALL "@{name}"', "OTHERSUB")
        return [
            self.full() if pen.chance(0.5) else self.some(),
            head,
            self.next() if pen.chance(0.5) else f"G90 {self.frame()} {self.full()}",
        ]

    def structure(self, depth: int, main: bool) -> list[str]:
        """A loop, a branch or a jump."""
        pen, one, two = self.pen, self.block(depth - 1, main, 2), self.block(depth - 1, main, 1)
        self.labels += 1
        label, kind = f"LAB{self.labels}", pen.whole(0, 7)
        where = f"$A_IN[{self.labels}]"
        mark = pen.pick(f"{label}:", f"{label}: {self.full()}", f"{label}: {self.some()}")
        if kind == 0:
            return [self.jump(f"IF {where}==1 GOTOF {label}"), *one, mark]
        if kind == 1:
            return [mark, *one, self.jump(f"IF {where}==1 GOTOB {label}")]
        if kind == 2:
            return [f"FOR R{10 + self.labels}=1 TO 2", *one, "ENDFOR"]
        if kind == 3:
            other = ["ELSE", *two] if pen.chance(0.5) else []
            return [f"IF {where}==1", *one, *other, "ENDIF"]
        if kind == 4:
            return [mark, *one, f"REPEAT {label} P=2"]
        if kind == 5:
            return [mark, *one, f"{label}E:", *two, f"REPEAT {label} {label}E"]
        if kind == 6:
            return [
                f"R{10 + self.labels}=0",
                f"WHILE R{10 + self.labels}<2",
                *one,
                f"R{10 + self.labels}=R{10 + self.labels}+1",
                "ENDWHILE",
            ]
        return ["REPEAT", *one, f"UNTIL {where}==1"]
