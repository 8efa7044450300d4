"""Executes the Siemens G-code of ``sinumerik_flow_programs``, written without the product."""

from __future__ import annotations

import re

import numpy as np
from controllers import Ended
from gcode_controller import STOP, GcodeController
from gcode_machine import rotation, shift

from robotrue.core.units import MM

SIEMENS_WORD = re.compile(
    r"(\$?[A-Z]\w*)\s*=\s*((?:\w+)?\([^()]*\)|\"\w+\"|[^ ]+)|([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+))"
)
OPENS = ("IF", "FOR", "WHILE", "LOOP", "REPEAT")
CLOSES = ("ENDIF", "ENDFOR", "ENDWHILE", "ENDLOOP", "UNTIL")


class SinumerikController(GcodeController):
    """Siemens': programs by name, labels and structures."""

    comments = re.compile(r";.*")

    def load(self, name: str, blocks: list[str]) -> None:
        """Takes the program of a file."""
        self.programs[name.partition(".")[0].upper()] = blocks

    def number(self, text: str) -> float:
        """An expression."""
        text = re.sub(r"\$A_IN\[\d+\]", "input", text).replace("<>", "!=")
        return float(self.compute(text))

    def act(self, block: str, program: list[str], at: int) -> int:
        """Executes a block."""
        block = re.sub(r"^[A-Z]\w+:\s*", "", block)
        if match := re.match(r"(?:IF (.*) )?GOTO([FB]?) (\w+)$", block):
            if match[1] and not self.number(match[1]):
                return at + 1
            places = self.find(program, match[3])
            if match[2]:
                places = [p for p in places if (p > at) == (match[2] == "F")]
            return places[0]
        word = re.match(r"\w*", block)[0]  # type: ignore[index]
        if match := re.match(r"REPEAT (\w+)(?: (\w+))?(?: P=(\d+))?$", block):
            first = self.find(program, match[1])[0]
            end = self.find(program, match[2])[0] + 1 if match[2] else at
            for _ in range(int(match[3] or 1)):
                if not self.stretch(program, first, end):
                    raise Ended  # no jump out of a repeated part is written
            return at + 1
        if word in OPENS or word in CLOSES or word == "ELSE":
            return self._structure(word, block, program, at)
        if self._call_named(block, word):
            return at + 1
        if word in ("M17", "M30", "M2", "RET"):
            return STOP
        if not self._frame(block, word):
            self._words(block)
        return at + 1

    def _structure(self, word: str, block: str, program: list[str], at: int) -> int:
        rest = block[len(word) :].strip()
        if word in ("IF", "WHILE"):
            holds = self.number(rest)
            other = self._partner(program, at, 1, "ELSE" if word == "IF" else "")
            return at + 1 if holds else other + 1
        if word == "ELSE":
            return self._partner(program, at, 1) + 1
        if word == "FOR":
            name, first, last = re.findall(r"(\w+)=(\S+) TO (\S+)", rest)[0]
            self.values[name] = self.number(first)
            fits = self.values[name] <= self.number(last)
            return at + 1 if fits else self._partner(program, at, 1) + 1
        if word in ("LOOP", "REPEAT", "ENDIF"):
            return at + 1
        begin = self._partner(program, at, -1)
        if word == "ENDFOR":
            name, last = re.findall(r"FOR (\w+)=\S+ TO (\S+)", program[begin])[0]
            self.values[name] += 1.0
            return begin + 1 if self.values[name] <= self.number(last) else at + 1
        if word == "UNTIL":
            return at + 1 if self.number(rest) else begin + 1
        return begin

    @staticmethod
    def _partner(program: list[str], at: int, way: int, other: str = "") -> int:
        """Where the structure of a block ends, or begins; or its other branch."""
        depth = 0
        while True:
            at += way
            block = re.sub(r"^(N\d+\s*)?([A-Z]\w+:\s*)?", "", program[at])
            word = block.split(" ")[0]
            plain = "GOTO" not in block and not re.match(r"REPEAT \w", block)
            step = way * ((word in OPENS and plain) - (word in CLOSES))
            if not depth and (step < 0 or (other and word == other)):
                return at
            depth += step

    def _call_named(self, block: str, word: str) -> bool:
        name, often = "", 1
        if match := re.match(r"MCALL\s*(\w*)(?:\((.*)\))?$", block):
            self.modal, self.given = match[1], match[2] or ""
            return True
        if match := re.match(r"CYCLE81\((.*)\)$", block):
            self._cycle(match[1])
            return True
        if match := re.match(r"CALL \"(\w+)\"$", block):
            name = match[1]
        elif match := re.match(r"(\w+)(?:\(\))?(?:\s+P=?\s*(\d+))?$", block):
            name, often = match[1], int(match[2] or 1)
        if word == "PROC":
            return True
        if name not in self.programs:
            return word in ("EXTERN", "MSG", "STOPRE", "DEF")
        for _ in range(often):
            self._call(name)
        return True

    def _call(self, name: str) -> None:
        machine, modal = self.machine, self.modal
        self.modal = ""
        head = self.programs[name][0]
        kept = machine.drive, machine.plane, machine.relative, machine.unit
        frame, shifts = machine.name, dict(machine.shifts)
        self.call(name)
        if re.search(r"\bSAVE\b", head):
            machine.drive, machine.plane, machine.relative, machine.unit = kept
            if frame != machine.name:
                machine.call(frame)
            machine.set_shift("program", shifts.get("program"))
        self.modal = modal

    def _frame(self, block: str, word: str) -> bool:
        machine = self.machine
        if match := re.match(r"\$P_UIFR\[(\d+)\]=(.*)$", block):
            T = np.eye(4)
            for kind, inside in re.findall(r"(CTRANS|CROT)\(([^()]*)\)", match[2]):
                fields = inside.split(",")
                value = np.zeros(3)
                for name, text in zip(fields[::2], fields[1::2], strict=True):
                    value["XYZ".index(name)] = self.number(text)
                T = T @ (shift(value * MM) if kind == "CTRANS" else rotation(value))
            number = int(match[1])
            machine.set_frame(f"G{(53 if number <= 4 else 500) + number}", T, at_once=False)
            return True
        if word not in ("TRANS", "ATRANS", "ROT", "AROT"):
            return False
        values = {
            a or c: self.number(b or d) for a, b, c, d in SIEMENS_WORD.findall(block[len(word) :])
        }
        vector = np.array([values.get(n, 0.0) for n in "XYZ"])
        if "RPL" in values:
            vector[(2, 1, 0)[machine.plane]] = values["RPL"]
        T = shift(vector * machine.unit) if "TRANS" in word else rotation(vector)
        before = machine.shifts.get("program", np.eye(4)) if word[0] == "A" else np.eye(4)
        machine.set_shift("program", before @ T if values or word[0] == "A" else None)
        return True

    def _words(self, block: str) -> None:
        machine = self.machine
        words: dict[str, tuple[float, bool]] = {}
        axes, once = np.full(6, np.nan), False
        centre, radius, middle = {}, None, np.full(3, np.nan)
        vector: dict[str, float] = {}
        for name in re.findall(r"\b(TRAORI|TRAFOOF|SUPA|CIP|CP|PTP)\b", block):
            once |= name == "SUPA"
            if name == "CIP":
                machine.drive = 4
            elif name in ("TRAORI", "TRAFOOF"):
                machine.tip = int(name == "TRAORI")
        for name, text, letter, plain in SIEMENS_WORD.findall(block):
            name, text = name or letter, text or plain
            if name in ("G", "M", "T", "D"):
                once |= self._code(name, text.strip('"'))
                continue
            mode = re.match(r"(AC|IC)\((.*)\)$", text)
            value = self.number(mode[2] if mode else text)
            if name in "XYZABC":
                words[name] = value, (mode[1] == "IC" if mode else machine.relative)
            elif name in ("I", "J", "K"):
                k = "IJK".index(name)
                from_start = mode is None or mode[1] == "IC"
                centre[name] = value * machine.unit - (0.0 if from_start else machine.where[k])
            elif name == "CR":
                radius = value * machine.unit
            elif name in ("I1", "J1", "K1"):
                middle["IJK".index(name[0])] = value * machine.unit
            elif name in ("A3", "B3", "C3"):
                vector[name] = value
            elif re.match(r"JT\d", name):
                axes[int(name[2]) - 1] = value
            elif re.match(r"R\d+$", name):
                self.values[name] = value
        if vector:
            machine.tip = 2
            machine.axis = np.array([vector[n] for n in ("A3", "B3", "C3")])
        elif machine.tip and any(n in words for n in "ABC"):
            machine.tip = 1
        if np.isfinite(axes).all():
            machine.to_axes(axes)
        elif once and words:
            machine.machine_move(words)
        elif machine.drive == 4 and np.isfinite(middle).all():
            machine.through(words, middle)
        elif vector and not words:
            machine.line(words)
        else:
            self.go(words, centre, radius)
        if words and self.modal == "CYCLE81":
            self._cycle(self.given)
        elif words and self.modal:
            self._call(self.modal)

    def _code(self, letter: str, text: str) -> bool:
        """A word that sets something; whether the block is in coordinates of the machine."""
        machine = self.machine
        if letter == "T":
            self.choose_tool(f"T{text}")
            return False
        number = float(text)
        if letter == "M":
            if number == 6.0:
                machine.load(self.chosen)
        elif letter == "D":
            return False
        elif number < 4:
            machine.drive = int(number)
        elif 17 <= number <= 19:
            machine.plane = int(number) - 17
        elif number in (90, 91):
            machine.relative = number == 91
        elif number in (70, 71, 700, 710):
            machine.unit = 25.4 * MM if number in (70, 700) else MM
        elif 54 <= number <= 57 or number in (500, 505):
            machine.call("" if number == 500 else f"G{number:g}")
        return number in (53, 153)

    def _cycle(self, given: str) -> None:
        """Drills where the robot is, and ends at the height of the first number."""
        back, top, gap, bottom = (self.number(text) * MM for text in given.split(","))
        for height in (top + gap, bottom):
            self.machine.where[2], self.machine.follow[2] = height, False
            self.machine.emit(follows=True)
        self.machine.where[2] = back
