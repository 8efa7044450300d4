"""Executes the Fanuc G-code of ``fanuc_gcode_flow_programs``, written without the product."""

from __future__ import annotations

import re

import numpy as np
from gcode_controller import STOP, GcodeController
from gcode_machine import Words, rotation, shift

from robotrue.core.units import MM

HOME = np.array([0.9, -0.4, 1.1])
"""Reference point of the axes of the machine, m."""
ARGUMENTS = dict(zip("ABCIJKDEFHMQRSTUVWXYZ", (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 13, *range(17, 27)),
                     strict=True))  # fmt: skip
"""Local variables of the words behind G65."""
WORDS = {" EQ ": "==", " NE ": "!=", " GT ": ">", " LT ": "<", " GE ": ">=", " LE ": "<="}
FANUC_WORD = re.compile(r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+)|[+-]?#\d+|\[[^\]]*\])")


class FanucGcodeController(GcodeController):
    """Fanuc's: programs by number, macros."""

    comments = re.compile(r"\([^)]*\)|;.*")

    def load(self, name: str, blocks: list[str]) -> None:
        """Takes the programs of a file; a number begins one."""
        number = ""
        for block in blocks:
            if match := re.match(r"O0*(\d+)", block):
                number = match[1]
                self.programs[number] = []
            elif number and not block.startswith("%"):
                self.programs[number].append(block)

    def number(self, text: str) -> float:
        """A number, a variable, or an expression in brackets."""
        for word, sign in WORDS.items():
            text = text.replace(word, sign)
        text = re.sub(r"#10[01]\d\b", "input", text)
        return float(
            self.compute(re.sub(r"#(\d+)", r"v\1", text.replace("[", "(").replace("]", ")")))
        )

    def act(self, block: str, program: list[str], at: int) -> int:
        """Executes a block."""
        if match := re.match(r"IF\s*(\[.*\])\s*(GOTO\s*(\d+)|THEN\s*(.*))$", block):
            if not self.number(match[1]):
                return at + 1
            if match[3]:
                return self.find(program, f"N{match[3]}")[0]
            block = match[4]
        if match := re.match(r"GOTO\s*(\d+)$", block):
            return self.find(program, f"N{match[1]}")[0]
        if match := re.match(r"WHILE\s*(\[.*\])\s*DO(\d)$", block):
            ends = [
                n for n in range(at, len(program)) if re.search(rf"\bEND{match[2]}$", program[n])
            ]
            return at + 1 if self.number(match[1]) else ends[0] + 1
        if match := re.match(r"END(\d)$", block):
            begins = [n for n in range(at) if re.search(rf"DO{match[1]}$", program[n])]
            return begins[-1]
        if match := re.match(r"#(\d+)=(.*)$", block):
            table = self.locals[-1] if int(match[1]) < 100 else self.values
            table[f"v{match[1]}"] = self.number(match[2])
            return at + 1
        return self._words(FANUC_WORD.findall(block), program, at)

    def _words(self, found: list[tuple[str, str]], program: list[str], at: int) -> int:
        words = {letter: self.number(text) for letter, text in found if letter not in "GM"}
        codes = {f"{letter}{float(text):g}" for letter, text in found if letter in "GM"}
        machine = self.machine
        self._set(codes)
        if "T" in words:
            self.choose_tool(f"T{words['T']:g}")
        if "M6" in codes:
            machine.load(self.chosen)
        if codes & {"G65", "G66"} and "P" in words:
            given = {f"v{ARGUMENTS[n]}": v for n, v in words.items() if n in ARGUMENTS}
            if "G66" in codes:
                self.modal = f"{words['P']:g}"
                return at + 1
            self._call(f"{words['P']:g}", given)
            return at + 1
        if not self._special(codes, words):
            self._move(codes, words)
        if "M98" in codes:
            number = f"{words['P']:g}"
            often = int(words.get("L", 1.0))
            if len(number) > 4:
                often, number = int(number[:-4]), number[-4:].lstrip("0")
            for _ in range(often):
                self._call(number, None)
            if self.target:
                target, self.target = self.target, ""
                return self.find(program, f"N{target}")[0]
        if "M99" in codes:
            self.target = f"{words['P']:g}" if "P" in words else ""
            return 0 if self.depth == 1 else STOP
        return STOP if codes & {"M30", "M2"} else at + 1

    def _call(self, name: str, given: dict[str, float] | None) -> None:
        if name not in self.programs:
            return
        modal, self.modal = self.modal, ""
        self.locals.append(self.locals[-1] if given is None else given)
        self.call(name)
        self.locals.pop()
        self.modal = modal

    def _set(self, codes: set[str]) -> None:
        machine = self.machine
        for code in codes:
            if code in ("G0", "G1", "G2", "G3", "G80", "G81", "G82", "G83"):
                if machine.drive < 81 or int(code[1:]) < 81:
                    self.initial = float(machine.where[2])
                machine.drive = int(code[1:])
            elif code in ("G17", "G18", "G19"):
                machine.plane = int(code[1:]) - 17
            elif code in ("G90", "G91"):
                machine.relative = code == "G91"
            elif code in ("G20", "G21"):
                machine.unit = 25.4 * MM if code == "G20" else MM
            elif code in ("G98", "G99"):
                self.to_initial = code == "G98"
            elif code in ("G90.1", "G91.1"):
                machine.absolute_centre = code == "G90.1"
            elif code in ("G43.4", "G43.5", "G49"):
                machine.tip = {"G43.4": 1, "G43.5": 2, "G49": 0}[code]
            elif code in ("G54", "G55", "G56", "G57"):
                machine.call(code)
            elif code == "G67":
                self.modal = ""
            elif code == "G69":
                machine.set_shift("rotation", None)

    def _special(self, codes: set[str], words: dict[str, float]) -> bool:
        machine, unit = self.machine, self.machine.unit
        given = {n: v * unit for n, v in words.items() if n in "XYZ"}
        if "G54.1" in codes:
            machine.call(f"G54.1 P{words['P']:g}")
            return False
        if "G4" in codes:
            return True
        if "G10" in codes:
            name = f"G{53 + words['P']:g}" if words["L"] == 2.0 else f"G54.1 P{words['P']:g}"
            T = np.array(machine.frames.get(name, np.eye(4)))
            for name_of, value in given.items():
                T["XYZ".index(name_of), 3] = value
            machine.set_frame(name, T, at_once=True)
        elif "G52" in codes or "G92" in codes:
            kind = "local" if "G52" in codes else "preset"
            T = np.array(machine.shifts.get(kind, np.eye(4)))
            for name, value in given.items():
                k = "XYZ".index(name)
                T[k, 3] = value if kind == "local" else T[k, 3] + machine.where[k] - value
            machine.set_shift(kind, T)
            if kind == "preset":
                machine.follow[["XYZ".index(n) for n in given]] = False
        elif "G68" in codes:
            centre = np.array([given["X"], given["Y"], 0.0])
            turn = rotation(np.array([0.0, 0.0, words["R"]]))
            machine.set_shift("rotation", shift(centre) @ turn @ shift(-centre))
        elif codes & {"G28", "G30"}:
            machine.go_home("".join(given), HOME)
        elif "G53" in codes:
            machine.machine_move({n: (words[n], False) for n in given})
        else:
            return False
        return True

    def _move(self, codes: set[str], words: dict[str, float]) -> None:
        machine = self.machine
        counted = {n: (v, machine.relative) for n, v in words.items() if n in "XYZABC"}
        if machine.drive >= 81:
            self.cycle.update({n: v * machine.unit for n, v in words.items() if n in "ZR"})
            if counted:
                self._drill(counted)
            return
        if machine.tip == 2 and "K" in words:
            machine.axis = np.array([words[n] for n in "IJK"])
            machine.line(counted)
            return
        if machine.drive in (2, 3):
            centre = {n: words[n] * machine.unit for n in "IJK" if n in words}
            radius = words["R"] * machine.unit if "R" in words else None
            self.go(counted, centre, radius)
            return
        self.go(counted, {}, None)
        if counted and self.modal and machine.drive < 80:
            self._call(self.modal, {})

    def _drill(self, words: Words) -> None:
        machine = self.machine
        machine.line({n: v for n, v in words.items() if n != "Z"})
        for height in (self.cycle["R"], self.cycle["Z"]):
            machine.where[2], machine.follow[2] = height, False
            machine.emit()
        machine.where[2] = self.initial if self.to_initial else self.cycle["R"]
