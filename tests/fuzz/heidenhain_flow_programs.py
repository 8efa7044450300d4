"""Conversational programs of labels, jumps, calls and shifts, by a seed; for their controller.

Not written, because manuals leave them to the machine or disagree: M89, M90, AXIS SPAT, contours of
SL cycles, a pole with one coordinate, datum tables.
"""

from __future__ import annotations

import numpy as np
from written import Pen

NUMBER = "+{:.3f}"


class HeidenhainFlowWriter:
    """Writes one program, and at times one that it calls."""

    def __init__(self, pen: Pen) -> None:
        self.pen = pen
        self.calm = pen.chance(0.7)
        self.tip = pen.chance(0.75)
        self.presets = pen.chance(0.4)
        self.labels = [1, 2][: pen.whole(0, 2)]
        self.jumps = pen.chance(0.4)
        self.inch = pen.chance(0.15)
        self.count = 10

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        pen = self.pen
        called = pen.chance(0.25)
        body = [*self._begin(), *self._block(2, pen.whole(4, 14))]
        if called:
            at = pen.whole(4, len(body))
            body[at:at] = [f"CALL PGM {pen.pick('SUB', 'TNC:' + chr(92) + 'SUB.H')}",
                           *self._restated()]  # fmt: skip
        body += [pen.pick("M30", "M2", "L Z+200 R0 FMAX M30", "STOP M30")]
        for label in self.labels:
            begin = self._restated() if pen.chance(0.5) else []
            body += [f"LBL {label}", *begin, *self._block(0, pen.whole(1, 4)), "LBL 0"]
        files = {"part.h": self._text("PART", body)}
        if called:
            self.labels = []
            begin = self._restated() if pen.chance(0.6) else []
            files["sub.h"] = self._text("SUB", [*begin, *self._block(0, pen.whole(1, 5))])
        return files

    def _text(self, name: str, body: list[str]) -> str:
        unit = "INCH" if self.inch else "MM"
        lines = [f"BEGIN PGM {name} {unit}", *body, f"END PGM {name} {unit}"]
        return "\n".join(f"{k} {line}" for k, line in enumerate(lines)) + "\n"

    # Numbers and words

    def _number(self, size: float = 900.0) -> str:
        decimals = 5 if self.inch else self.pen.whole(3, 5)
        return f"{self.pen.rng.uniform(-size, size) / (25.4 if self.inch else 1.0):+.{decimals}f}"

    def _angle(self, size: float = 80.0) -> str:
        return f"{self.pen.rng.uniform(-size, size):+.4f}"

    def _point(self, names: str = "XYZ") -> str:
        return " ".join(f"{name}{self._number()}" for name in names)

    def _axis(self) -> str:
        v = self.pen.rng.normal(size=3) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
        v = v / np.linalg.norm(v)
        return " ".join(f"T{name}{value:+.7f}" for name, value in zip("XYZ", v, strict=True))

    def _full(self) -> str:
        turn = " ".join(f"{name}{self._angle()}" for name in "ABC")
        return (
            f"L {self._point()}{' ' + turn if self.tip else ''} R0 {self.pen.pick('FMAX', 'F500')}"
        )

    def _tool(self) -> str:
        tool = self.pen.pick("1", "1", "1", "2", "1.1", '"MILL"', "9")
        return f"TOOL CALL {tool} Z S5000{self.pen.pick('', ' DL+0', ' F500')}"

    def _lead(self) -> str:
        if not self.tip:
            return "M129"
        return self.pen.pick("M128", "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS")

    def _preset(self, number: str) -> list[str]:
        if self.pen.chance(0.5):
            return [f"CYCL DEF 247 DATUM SETTING Q339=+{number}"]
        return ["CYCL DEF 247 DATUM SETTING ~", f"Q339=+{number} ;NR"]

    def _begin(self) -> list[str]:
        pen = self.pen
        lines = ["BLK FORM 0.1 Z X-50 Y-50 Z-20", "BLK FORM 0.2 X+50 Y+50 Z+0"]
        lines += [self._tool()] if pen.chance(0.95) else []
        lines += self._preset(pen.pick("1", "2", "2", "7")) if self.presets else []
        lines += ["Q1 = +5", "FN 0: Q2 = +12.5", "FN 18: SYSREAD Q3 = ID990 NR2"]
        lines += [self._lead()] if pen.chance(0.9) else []
        return [*lines, *([self._full()] if pen.chance(0.9) else [])]

    def _restated(self) -> list[str]:
        """Every state again, as it has to be behind a label; now and then one is forgotten."""
        preset = self._preset(self.pen.pick("1", "2"))
        lines = [self._tool(), "TRANS DATUM RESET", self._lead(), *preset, self._full()]
        return [each for each in lines if self.pen.chance(0.93) or each == lines[-1]]

    # Blocks

    def _block(self, depth: int, size: int) -> list[str]:
        return [line for _ in range(size) for line in self._statement(depth)]

    def _statement(self, depth: int) -> list[str]:
        pen, kind = self.pen, self.pen.whole(0, 36)
        if self.calm and 16 <= kind <= 27 and pen.chance(0.75):
            kind = 0
        if kind <= 9:
            return [self._line()]
        if kind == 10:
            return [f"LN {self._point()} NX+0.0 NY+0.0 NZ+1.0 {self._axis()} F1000"]
        if kind == 11:
            some = self._point(pen.pick("XYZ", "XY", "Z"))
            return [f"LN {some} {pen.pick('NX+0 NY+0 NZ+1', self._axis())}"]
        if kind <= 14:
            return self._arc()
        if kind == 15:
            return [self._line(), pen.pick("RND R0.5", "CHF 0.5"), self._line()]
        if kind <= 20:
            return self._odd()
        if kind <= 25:
            return self._shifted()
        if kind <= 27:
            return [self._state()]
        if not depth:
            return [f"L {self._point()}"]
        return self._flow(kind, depth)

    def _flow(self, kind: int, depth: int) -> list[str]:
        pen = self.pen
        if kind <= 29 and self.labels:
            again = self._restated() if pen.chance(0.6) else []
            return [f"CALL LBL {pen.pick(*map(str, self.labels))}", *again]
        self.count += 1
        label = self.count
        begin = self._restated() if pen.chance(0.6) else []
        inner = self._block(0, pen.whole(1, 3))
        again = self._restated() if pen.chance(0.5) else []
        if kind == 30 or (kind == 31 and not self.jumps):
            return [
                f"LBL {label}",
                *begin,
                *inner,
                f"CALL LBL {label} REP{pen.whole(1, 2)}",
                *again,
            ]
        if kind <= 33 and self.jumps:
            jump = pen.pick(
                "9: IF +Q3 EQU +1", "10: IF +Q3 NE +1", "11: IF +Q3 GT +1", "12: IF +Q1 LT +7"
            )
            return [f"FN {jump} GOTO LBL {label}", *begin, *inner, f"LBL {label}", *again]
        if kind == 34:
            return [f"/{self._line()}" if pen.chance(0.5) else f"/ {self._line()}", self._line()]
        return [self._line()]

    def _line(self) -> str:
        pen, kind = self.pen, self.pen.whole(0, 11)
        names = pen.pick("XYZ", "XYZ", "XY", "X", "Z", "YZ")
        if kind <= 6 or not self.tip:
            tail = pen.pick("", " F1000", " R0 FMAX", " ; X1", " M3", " FQ1")
            return f"L {self._point(names)}{tail}"
        turn = pen.pick("ABC", "ABC", "A", "BC", "C")
        return f"L {self._point(names)} " + " ".join(f"{n}{self._angle()}" for n in turn)

    def _arc(self) -> list[str]:
        """A start with both coordinates, and one arc, or two of one pole."""
        pen, rng = self.pen, self.pen.rng
        unit = 25.4 if self.inch else 1.0
        shown = "{:+.5f}" if self.inch else "{:+.4f}"
        start = np.array([rng.uniform(-300.0, 300.0), rng.uniform(-300.0, 300.0)])
        out = rng.uniform(20.0, 90.0) * np.array([np.cos(a := rng.uniform(0.0, 6.2)), np.sin(a)])
        turn, left = float(rng.uniform(0.4, 2.4)), pen.chance(0.5)

        def at(angle: float) -> np.ndarray:
            c, s = np.cos(angle if left else -angle), np.sin(angle if left else -angle)
            return start - out + np.array([[c, -s], [s, c]]) @ out

        def words(point: np.ndarray) -> str:
            return " ".join(
                f"{n}{shown.format(v / unit)}" for n, v in zip("XY", point, strict=True)
            )

        sense = "DR+" if left else "DR-"
        first = f"L {words(start)}{' ' + self._point('Z') if pen.chance(0.4) else ''}"
        kind = pen.whole(0, 9)
        end = start if kind == 0 else at(turn)
        if kind <= 2:
            lines = [first, f"CC {words(start - out)}", f"C {words(end)} {sense}"]
        elif kind == 3:
            step = " ".join(
                f"I{n}{shown.format(-v / unit)}" for n, v in zip("XY", out, strict=True)
            )
            lines = [f"CC {words(start)}", first, f"CC {step}", f"C {words(end)} {sense}"]
        elif kind == 4:
            lines = [first, f"CC {words(start - out)}", f"C {words(end)} {sense}",
                     f"C {words(at(turn + 0.7))} {sense}"]  # fmt: skip
        elif kind == 5:
            lines = [first, f"CC {words(start - out)}", f"C {words(end)} {sense}",
                     f"LP PR{self._number(300.0)} PA{self._angle()}"]  # fmt: skip
        elif kind == 6:
            lines = [first, f"CC {words(start - out)}", f"C {words(end)} {sense}",
                     pen.pick("CP IPA+360 IZ+2 DR+", f"CP PA{self._angle()} DR+")]  # fmt: skip
        elif kind == 7:
            lines = [
                first,
                f"CC {words(start - out)}",
                self._line(),
                first,
                f"C {words(end)} {sense}",
            ]
        else:
            size = f"{shown.format(np.hypot(*out) / unit)}"
            lines = [first, f"CR {words(end if kind else at(turn))} R{size} {sense}"]
        return [*lines, *([self._line()] if pen.chance(0.5) else [])]

    def _odd(self) -> list[str]:
        pen, kind = self.pen, self.pen.whole(0, 13)
        if kind <= 3:
            name = pen.pick("X", "Y", "Z")
            more = pen.pick(
                "", "", " " + self._point("XYZ".replace(name, "")), " IY+2" * (name != "Y")
            )
            return [
                f"L I{name}{self._number(20.0)}{more}",
                *([self._line()] if pen.chance(0.6) else []),
            ]
        if kind == 4 and self.tip:
            return [f"L IC{self._angle(5.0)}{pen.pick('', ' ' + self._point('X'))}"]
        if kind <= 6:
            return [f"L {pen.pick('X+Q1', 'Y-Q2', 'Z+Q2 X+1')}{pen.pick('', ' A+Q1' * self.tip)}"]
        if kind == 7:
            side = pen.pick("RL", "RR")
            return [f"L {self._point('XY')} {side} F200", self._line(), f"L {self._point('XY')} R0"]
        if kind == 8:
            return [f"CT {self._point(pen.pick('XY', 'X'))}"]
        if kind == 9:
            return [f"APPR LT {self._point('XY')} LEN15 R0 F300", self._line(),
                    pen.pick("DEP LT LEN20", "DEP LN LEN+20 F2000"), self._line()]  # fmt: skip
        if kind == 10:
            return [f"L {self._point(pen.pick('Z', 'XY'))} R0 FMAX M91", self._line()]
        if kind == 11:
            call = pen.pick(f"L {self._point('XY')} R0 FMAX M99", "CYCL CALL")
            define = ["CYCL DEF 200 DRILLING ~", "Q200=2 ;CLEARANCE ~", "Q201=-20 ;DEPTH"]
            return [*define, call, self._line()]
        if kind == 12:
            return [f"L {self._point('XY')} {pen.pick('M128', 'M129')}", self._line()]
        return [f"Q{pen.whole(1, 2)} = {self._number(30.0)}", "FN 1: Q4 = +Q1 + +3"]

    def _shifted(self) -> list[str]:
        pen = self.pen
        on, off = self._datum() if pen.chance(0.5) else self._transform()
        inner = [self._line() for _ in range(pen.whole(1, 2))]
        if pen.chance(0.75):
            lines = [*on, *inner, *off]
        else:
            lines = on if pen.chance(0.5) else off
        return [*lines, *([self._full()] if pen.chance(0.6) else []), self._line()]

    def _datum(self) -> tuple[list[str], list[str]]:
        """A shift of the datum, and what ends it, or a part of it."""
        pen, kind, head = self.pen, self.pen.whole(0, 4), self.pen.pick("", " DATUM SHIFT")
        axes = pen.pick("X", "X", "Y") if kind else pen.pick("XYZ", "XYZ", "X", "Y")
        zero = [f"CYCL DEF 7.0{head}", *(f"CYCL DEF 7.{'0XYZ'.index(n)} {n}+0" for n in axes)]
        size = self._number(90.0)
        if kind == 0:
            return [zero[0], "CYCL DEF 7.1 X+7", f"CYCL DEF 7.2 Y{size}"], zero
        if kind == 1:
            return [zero[0], f"CYCL DEF 7.1 X{size}"], zero
        if kind == 2:
            back = pen.pick("IX+0", "X+0")
            return [zero[0], f"CYCL DEF 7.1 IX{size}"], [zero[0], f"CYCL DEF 7.1 {back}"]
        if kind == 3:
            return [zero[0], "CYCL DEF 7.1 X+Q1"], zero
        back = pen.pick("RESET", "AXIS X+0 Y+0 Z+0", "AXIS Y+0")
        return [f"TRANS DATUM AXIS X{size}"], [f"TRANS DATUM {back}"]

    def _transform(self) -> tuple[list[str], list[str]]:
        """A mirror, rotation, scale or tilt, and what ends it."""
        pen = self.pen
        number, on, off = [
            ("8", pen.pick("X", "Y", "X Y"), ""),
            ("10", f"ROT{self._angle()}", f"{pen.pick('', '', 'I')}ROT+0"),
            ("11", "SCL 0.995", "SCL 1"),
            ("19", f"A{self._angle()} B+0", "A+0 B+0 C+0"),
            ("", f"PLANE SPATIAL SPA{self._angle()} SPB+0 SPC+0", "PLANE RESET"),
        ][pen.whole(0, 4)]
        if not number:
            return [f"{on} {self._how()}"], [f"{off} {self._how()}"]
        one, other = (
            [f"CYCL DEF {number}.0", f"CYCL DEF {number}.1 {what}".rstrip()] for what in (on, off)
        )
        return one, other

    def _how(self) -> str:
        return self.pen.pick("STAY", "STAY", "TURN FMAX", "MOVE DIST50 FMAX")

    def _state(self) -> str:
        pen, kind = self.pen, self.pen.whole(0, 5)
        if kind == 0:
            return pen.pick("M128", "M129", "FUNCTION RESET TCPM")
        if kind <= 2:
            return self._tool()
        if kind == 3 and self.presets:
            return f"CYCL DEF 247 DATUM SETTING Q339=+{pen.pick('1', '2')}"
        return pen.pick(
            "TOOL CALL Z S3000", "TOOL CALL Q1 Z S100", "M8", "* - NEXT", "TOOL CALL S900"
        )
