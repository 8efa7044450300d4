"""Yaskawa jobs of branches, loops, calls, shifts and P variables, by a seed.

For ``jbi_controller``. Not written, because no manual at hand states what they do: CNTR and
CHANGE TOOL#, turned shifts, coordinated motion (SMOV), and axes of a station that carry a frame.
"""

from __future__ import annotations

from written import Pen

SHIFTS = (9, 10)
"""P variables of displacements; 11 is that of IMOV, those below are positions."""
PLACES = 6
HEADERS = {
    "BASE": "///POSTYPE BASE\n///RECTAN", "ROBOT": "///POSTYPE ROBOT\n///RECTAN",
    "USER 1": "///USER 1\n///POSTYPE USER\n///RECTAN",
    "USER 2": "///USER 2\n///POSTYPE USER\n///RECTAN", "PULSE": "///POSTYPE PULSE\n///PULSE",
    "ANGLE": "///POSTYPE ANGLE\n///ANGLE",
}  # fmt: skip


class JbiFlowWriter:
    """Writes one job and those it calls."""

    def __init__(self, pen: Pen) -> None:
        self.pen, self.labels, self.depth = pen, 0, 0
        self.calm = pen.chance(0.6)
        self.subs = [f"SUB{k}" for k in range(pen.whole(0, 2))]
        self.frame = pen.pick("BASE", "BASE", "USER 1", "USER 2", "ROBOT")
        self.relative: dict[str, str] = {}
        self.places = {k: self._point(k) for k in range(1, 12)}
        self.points: list[str] = []
        self.stations = 0

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        for name in self.subs:
            if self.pen.chance(0.12):
                self.relative[name] = self.pen.pick("1", "2")
        out = {"part.jbi": self._file("PART", 2, self.pen.whole(3, 10))}
        for name in self.subs:
            out[f"{name.lower()}.jbi"] = self._file(name, 1, self.pen.whole(1, 4))
        return out

    def _file(self, name: str, depth: int, size: int) -> str:
        self.points, self.stations = [], 0
        body = self._block(depth, name, size)
        text = "\n".join(body)
        stated = [k for k in self.places if f"P{k:03d}" in text or f"PX{k:03d}" in text]
        if "P[" in text:
            stated = [k for k in self.places if k in stated or k <= 3]
        for k in stated:
            other = self.pen.chance(0.06)  # exported before the variable got its value
            self.points.append(self._point(k) if other else self.places[k])
        stations = [f"EC{k:05d}={self.pen.pick('0', '0', '5000')}" for k in range(self.stations)]
        if stations:
            stations = ["///POSTYPE PULSE", "///PULSE", *stations]
        counts = f"{len(self.points) - len(stated)},0,{self.stations},{len(stated)},0,0"
        argument = ["//ARGINFO", "///ARGTYPE I,,,,,,,", "///COMMENT", "part"]
        head = ["/JOB", f"//NAME {name}", *(argument if "GETARG" in text else []), "//POS"]
        head += [f"///NPOS {counts}", *self.points, *stations, "//INST"]
        head += ["///DATE 2026/11/21 08:11", "///ATTR SC,RW" + ",RJ" * (name in self.relative)]
        if name in self.relative:
            head.append(f"////FRAME USER {self.relative[name]}")
        groups = "RB1,ST1" if stations else "RB1"
        return "\n".join([*head, f"///GROUP1 {groups}", "NOP", *body, "END"]) + "\n"

    def _point(self, number: int, kind: str = "P", frame: str = "") -> str:
        """Header and position of a P variable, or of a C position of this file."""
        rng, pen = self.pen.rng, self.pen
        frame = frame or pen.pick(*(self.frame,) * 7, "PULSE", "PULSE", "USER 1", "ANGLE")
        tool = pen.pick("1", "1", "1", "2")
        name = f"{kind}{number:05d}"
        if kind == "P" and number >= min(SHIFTS):
            frame = pen.pick("BASE", self.frame)
            values = [f"{v:.3f}" for v in rng.uniform(-50, 50, 3)] + ["0.0000"] * 3
        elif frame == "PULSE":
            values = [str(v) for v in rng.integers(-60_000, 60_000, 6)]
        elif frame == "ANGLE":
            values = [f"{v:.4f}" for v in rng.uniform(-90, 90, 6)]
        else:
            values = [f"{v:.3f}" for v in rng.uniform(-1200, 1200, 3)]
            values += [f"{v:.4f}" for v in rng.uniform(-75, 75, 3)]
        header = f"{HEADERS[frame]}\n///TOOL {tool}"
        if frame not in ("PULSE", "ANGLE"):
            header += "\n///RCONF 1,0,0,0,0,0"
        return f"{header}\n{name}={','.join(values)}"

    # What instructions name

    def _new(self, name: str) -> str:
        """A C position that only the next move goes to."""
        number = len([point for point in self.points if "\nC" in point])
        if number and self.pen.chance(0.04):
            return f"C{self.pen.whole(0, number - 1):05d}"
        frame = f"USER {self.relative[name]}" if name in self.relative else ""
        self.points.append(self._point(number, "C", frame))
        return f"C{number:05d}"

    def _place(self) -> str:
        return f"P{self.pen.whole(1, PLACES):03d}"

    def _whole(self) -> str:
        """The name that some instructions want for a P variable with its axes."""
        return self._place().replace("P", "PX")

    def _shift(self) -> str:
        return f"P{self.pen.whole(*SHIFTS):03d}"

    def _tag(self) -> str:
        return self.pen.pick("BF", "RF", "TF", "UF#(1)", "UF#(2)", "UF#(B001)")

    def _condition(self) -> str:
        return self.pen.pick("IN#(1)=ON", "B000=1", "I000>1", "D000>2000", "IN#(2)=OFF")

    def _target(self, name: str) -> str:
        kind = self.pen.whole(0, 19)
        if kind <= 14:
            return self._new(name)
        return self._place() if kind <= 18 else self.pen.pick("P[I000]", "LP001", self._place())

    def _move(self, name: str) -> str:
        word = self.pen.pick("MOVL", "MOVL", "MOVJ")
        speed = "VJ=20.00" if word == "MOVJ" else "V=200.0"
        more = self.pen.whole(0, 39)
        target = self._target(name)
        tail = self.pen.pick("", "", " PL=0", " PL=2", " NWAIT", " UNTIL IN#(3)=ON")
        if more == 0:
            tail += f" TL#({self.pen.whole(1, 2)})"
        elif more == 1:
            tail += f" +SFTON3D {self._shift()}"
        elif more <= 3:
            self.stations += 1
            station = f"EC{self.stations - 1:05d}"
            if more == 2:
                return f"{word} {target} {station} {speed}{tail}"
            tail += f" +MOVJ {station} VJ=5.00"
        return f"{word} {target} {speed}{tail}"

    # Statements

    def _block(self, depth: int, name: str, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 4)
        return [line for _ in range(count) for line in self._statement(depth, name)]

    def _statement(self, depth: int, name: str) -> list[str]:
        kind, pen = self.pen.whole(0, 30), self.pen
        if self.calm and 12 <= kind <= 20 and pen.chance(0.75):
            kind = 0
        if kind <= 9:
            return [self._move(name)]
        if kind == 10:
            turns = pen.pick("MOVC", "MOVC", "MOVS")
            fixed = " FPT" if turns == "MOVC" and pen.chance(0.2) else ""
            count = pen.whole(3, 5)
            return [f"{turns} {self._target(name)} V=50.0{fixed * (k == 2)}" for k in range(count)]
        if kind == 11:
            return [pen.pick("DOUT OT#(1) ON", "TIMER T=0.50", f"REFP 1 {self._new(name)}",
                             "INC I000", "SET B000 1", "SET D000 5000", "SET B000 0")]  # fmt: skip
        if kind <= 16:
            return [self._setting(kind, name)]
        if kind == 17:
            inside = self._block(max(depth - 1, 0), name)
            return [f"SFTON {self._shift()} {self._tag()}", *inside, "SFTOF"]
        if kind == 18:
            on = f"SFTON {self._shift()}", f"SFTON P011 {self._tag()}"
            return [pen.pick("SFTOF", "SFTOF", *on)]
        if kind <= 20:
            return [self._computation(name)]
        return self._structure(kind, depth, name) if depth else [self._move(name)]

    def _setting(self, kind: int, name: str) -> str:
        """Of P variables."""
        pen, one, two = self.pen, self._place(), self._place()
        if kind == 12:
            return f"IMOV P011 V=20.0 {self._tag()}"
        if kind <= 14:
            return pen.pick(f"SET {one} {two}", f"ADD {one} {self._shift()}", f"SUB {one} {two}",
                            f"SET LP001 {one}", f"SET {self._shift()} P010",
                            f"SET P[I000] {two}")  # fmt: skip
        number = pen.pick("D000", str(pen.whole(-90_000, 90_000)))
        return pen.pick(f"SETE {one} ({pen.whole(1, 6)}) {number}", f"SETE {one} TL#(2)",
                        f"SETE {self._shift()} ({pen.whole(1, 3)}) {number}",
                        f"GETE D000 {one} ({pen.whole(1, 6)})")  # fmt: skip

    def _computation(self, name: str) -> str:
        pen, one = self.pen, self._whole()
        return pen.pick(
            f"GETS {one} $PX001", f"GETPOS {one} STEP#({pen.whole(1, 4)})",
            f"CNVRT {one} {self._whole()} {self._tag()}".replace("TF", "BF"),
            f"MSHIFT PX{pen.whole(*SHIFTS):03d} BF {one} {self._whole()}",
            f"MFRAME UF#({pen.whole(1, 2)}) {one} {self._whole()} {self._whole()}",
            f"MFRAME UF#({pen.pick('2', 'B001')}) {self._place()} BF", "SETTOOL TL#(2) P010",
            "SET B001 2", "SET B001 1",
        )  # fmt: skip

    def _structure(self, kind: int, depth: int, name: str) -> list[str]:
        pen, one = self.pen, self._block(depth - 1, name)
        self.labels += 1
        label = f"*L{self.labels}"
        if kind <= 22:
            other = ["ELSE", *self._block(depth - 1, name)] if pen.chance(0.5) else []
            return [f"IFTHENEXP {self._condition()}", *one, *other, "ENDIF"]
        if kind == 23:
            return ["FOR I000 START= 1 TO 2 STEP=1", *one, "NEXT I000"]
        if kind == 24:
            trap = f"MOVL {self._new(name)} V=5.0 TRAP {label}"
            return [pen.pick(f"JUMP {label} IF {self._condition()}", trap), *one, label]
        if kind == 25:
            return [label, *one, f"JUMP {label} IF IN#(4)=ON"]
        if kind == 26:
            return [*one, f"RET IF {self._condition()}"] if name != "PART" else one
        return [*one, self._call(name)]

    def _call(self, name: str) -> str:
        pen = self.pen
        others = [each for each in self.subs if each > name or name == "PART"]
        if not others or pen.chance(0.08):
            return pen.pick("CALL JOB:GONE", "MACRO1 MJ#(1) ARGF10", self._move(name),
                            "GETARG LI000 IARG#(1)", "CALL JOB:GONE IF IN#(5)=ON")  # fmt: skip
        sub = pen.pick(*others)
        tail = pen.pick("", "", "", " (2)", f" IF {self._condition()}")
        if sub in self.relative and pen.chance(0.3):
            tail = f" UF#({pen.pick('1', '2', 'B001')})"
        return f"{pen.pick('CALL', 'CALL', 'CALL', 'CALL', 'CALL', 'JUMP')} JOB:{sub}{tail}"
