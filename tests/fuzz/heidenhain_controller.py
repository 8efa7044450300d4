"""Executes the conversational programs of ``heidenhain_flow_programs``, without the product.

Meant is what an iTNC 530 and a TNC 640 do. A coordinate that a block leaves out
stays where the axis is, whatever moved the zero since; increments count from there, and a pole in
increments from the last position. M128 holds from the begin of its block, M129 from its end. A
preset that is called ends shift, mirror, rotation and scale. Where the tool is at the start, after
a tool change, a cycle or a tilt that turns, is drawn from a seed, as are measured values and the
switch for blocks that may be skipped. Each run begins with the preset and tool of the cell.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping

import numpy as np
from controllers import MOST_STEPS, Arc, Ended, Move

from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM

INCH, MISS, FAR = 25.4, 0.02, 300.0
WORD = re.compile(r"\b(I?)([TN][XYZ]|PR|PA|[XYZABC])([+-]?(?:Q\d+|[\d.]+))(?= |$)")
SYNTAX = re.compile(
    r"\w+(?: I?[XYZABC][+-]?[Q\d][\d.]*)*(?: P[RA]\S+| IPA\S+| LEN\S+)*(?: IZ\S+)?"
    r"(?: [NT][XYZ]\S+)*(?: R[+-][\d.]+)?(?: DR[+-])?(?: R[0LR])?(?: F\S+)?(?: M\d+)*"
)
"""Words of a block in the order that the editor of the control asks for them."""
RELATIONS = {"9": operator.eq, "10": operator.ne, "11": operator.gt, "12": operator.lt}
SUMS = {"0": lambda a: a, "1": operator.add, "2": operator.sub, "3": operator.mul}
SIDE = {"Z": (0, 1, 2), "Y": (2, 0, 1), "X": (1, 2, 0)}
Words = dict[str, tuple[bool, float]]


class HeidenhainController:
    """Programs that call each other; the first one is run.

    Args:
        files: Their texts by name.
        frames: Presets and tools of the cell by name; the empty name: those before any call.
        rng: Decides what the program cannot know.
    """

    def __init__(
        self,
        files: Mapping[str, str],
        frames: Mapping[str, Mapping[str, np.ndarray]],
        rng: np.random.Generator,
    ) -> None:
        self.frames, self.rng, self.moves = frames, rng, list[Move]()
        self.programs = {
            name.partition(".")[0].upper(): [
                re.sub(r"^(/?) ?\d+ (/?) ?", r"\1\2", line.partition(";")[0]).strip(" ~")
                for line in text.splitlines()
            ]
            for name, text in files.items()
        }

    def run(self) -> bool:
        """Runs the first program; returns whether it came to its end."""
        self.skips, self.steps = bool(self.rng.random() < 0.5), 0
        self.values: dict[str, float] = {}
        self.here, self.turn = self._somewhere(), np.zeros(3)
        self.by_axis = self.tip = False
        self.preset = self.tool = ""
        self.side = SIDE["Z"]
        self.pole: np.ndarray | None = None
        self.cycle = False
        self.plane = np.eye(3)
        self._reset()
        try:
            self._program(next(iter(self.programs)))
        except Ended:
            return False
        return True

    def _reset(self) -> None:
        self.shift, self.rotation, self.scale = np.zeros(3), 0.0, np.ones(3)
        self.mirrored = np.ones(3)

    def _somewhere(self) -> np.ndarray:
        return self.rng.uniform(-FAR, FAR, 3)

    def _lose(self) -> None:
        self.here, self.turn, self.by_axis = self._somewhere(), self._somewhere() / 4.0, False

    # Order of blocks

    def _program(self, name: str) -> None:
        lines = self.programs[name]
        labels = {line[4:]: at for at, line in enumerate(lines) if line.startswith("LBL ")}
        before, self.unit = getattr(self, "unit", 1.0), 1.0
        returns: list[int] = []
        repeated: dict[int, int] = {}
        at = 0
        while at < len(lines):
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            line, at = lines[at], at + 1
            if line.startswith("/"):
                if self.skips:
                    continue
                line = line[1:]
            if begun := re.match(r"BEGIN PGM \w+ (MM|INCH)$", line):
                self.unit = INCH if begun[1] == "INCH" else 1.0
            elif line == "LBL 0" and returns:
                at = returns.pop()
            elif call := re.match(r"CALL LBL (\w+)(?: REP(\d+))?$", line):
                if call[2] is None:
                    returns.append(at)
                    at = labels[call[1]]
                elif repeated.setdefault(at, 0) < int(call[2]):
                    repeated[at] += 1
                    at = labels[call[1]]
                else:
                    del repeated[at]
            elif jump := re.match(
                r"FN (\d+): IF (\S+) (?:EQU|NE|GT|LT) (\S+) GOTO LBL (\w+)", line
            ):
                if RELATIONS[jump[1]](self._value(jump[2]), self._value(jump[3])):
                    at = labels[jump[4]]
            elif call := re.match(r"CALL PGM (?:TNC:\\)?(\w+)", line):
                self._program(call[1].upper())
            elif re.search(r"\bM(2|30)$", line):
                return
            else:
                self._act(line)
        self.unit = before

    def _value(self, text: str) -> float:
        sign, name = (-1.0 if text[0] == "-" else 1.0), text.lstrip("+-")
        if name[0] != "Q":
            return sign * float(name)
        if name not in self.values:
            raise Ended
        return sign * self.values[name]

    # Blocks

    def _act(self, line: str) -> None:
        head = line.partition(" ")[0]
        if head in ("L", "LN", "C", "CR", "CT", "LP", "CP", "CC", "APPR", "DEP"):
            self._go(head, line)
        elif line.startswith("TOOL CALL "):
            self._change(line[10:])
        elif part := re.match(r"CYCL DEF (\d+)\.(\d)(.*)$", line):
            self._transform(int(part[1]), int(part[2]), part[3].strip())
        elif (found := re.search(r"Q339=\+(\w+)", line)) and (self.cycle or "247" in line):
            self._call(f"preset {found[1]}")
        elif line.startswith("TRANS DATUM"):
            if "RESET" in line:
                self.shift = np.zeros(3)
            else:
                self._shift(line)
        elif line.startswith("PLANE"):
            self.plane = self._tilt(line)
            if "STAY" not in line:
                self._lose()
        elif line.startswith(("CYCL CALL", "M99")):
            self._lose()
        elif re.match(r"Q\d+ = |FN [0-3]:", line):
            self._assign(line)
        elif found := re.match(r"FN 18: SYSREAD (Q\d+)", line):
            self.values[found[1]] = float(self.rng.integers(0, 3))
        elif "TCPM" in line or re.match(r"M12[89]", line):
            self._lead("RESET" not in line and "M129" not in line)
        self.cycle = line.startswith("CYCL DEF 247")

    def _assign(self, line: str) -> None:
        match = re.match(r"(?:FN (\d): )?(Q\d+) = (\S+)(?: [+*-] (\S+))?$", line)
        assert match, line
        given = [self._value(each) for each in match.groups()[2:] if each]
        kind = match[1] or ("1" if match[4] else "0")
        self.values[match[2]] = float(SUMS[kind](*given))

    def _change(self, rest: str) -> None:
        match = re.match(r"(\d+(?:\.\d)?|Q\d+|\"\w*\")?(?: ?([XYZ]))?(?= |$)", rest)
        if match and match[1]:
            named = match[1].strip('"')
            number = f"{self._value(named):g}" if named[0] == "Q" else named
            self.tool = f"T{number}" if number[0].isdigit() else number
            self._lose()
        if match and match[2]:
            self.side = SIDE[match[2]]

    def _call(self, preset: str) -> None:
        if preset != self.preset:
            self.here = self._somewhere()
        self._reset()
        self.preset = preset

    def _lead(self, on: bool) -> None:
        if on != self.tip and (self.by_axis or self.turn.any()):
            self.here = self._somewhere()
        self.tip = on

    # Coordinates

    def _transform(self, cycle: int, part: int, rest: str) -> None:
        if cycle == 7 and part:
            self._shift(rest)
        elif cycle == 8 and part:
            self.mirrored = np.array([-1.0 if axis in rest else 1.0 for axis in "XYZ"])
        elif cycle == 10 and part:
            turn = re.match(r"(I?)ROT([+-][\d.]+)$", rest)
            assert turn, rest
            self.rotation = float(turn[2]) + (self.rotation if turn[1] else 0.0)
        elif cycle == 11 and part:
            self.scale = np.full(3, float(rest[3:]))
        elif cycle == 19 and part:
            self.plane = self._tilt(rest)

    def _tilt(self, text: str) -> np.ndarray:
        angles = dict(re.findall(r"([ABC])([+-][\d.]+)", text))
        return matrix_from_abc(np.array([float(angles.get(name, 0)) for name in "CBA"]) * DEG)

    def _shift(self, text: str) -> None:
        if "#" in text:
            self.shift = self._somewhere()
        for name, (adds, value) in self._words(text).items():
            k = "XYZ".index(name)
            self.shift[k] = value * self.unit + (self.shift[k] if adds else 0.0)

    def _matrix(self) -> np.ndarray:
        """The affine (4, 4) from what is programmed to the preset, mm."""
        T, turn = np.eye(4), matrix_from_abc(np.array([self.rotation, 0.0, 0.0]) * DEG)
        T[:3, :3] = self.plane @ np.diag(self.mirrored) @ turn @ np.diag(self.scale)
        T[:3, 3] = self.plane @ self.shift
        return T

    def _words(self, text: str) -> Words:
        return {
            name: (bool(adds), self._value(number)) for adds, name, number in WORD.findall(text)
        }

    # Motions

    def _go(self, head: str, line: str) -> None:
        if head not in ("APPR", "DEP") and not SYNTAX.fullmatch(line):
            raise Ended  # the control takes no such block
        words, T = self._words(line), self._matrix()
        start = np.linalg.solve(T, np.append(self.here, 1.0))[:3]
        end, step = start.copy(), np.zeros(6)
        if head == "CC":
            self.pole = start.copy()
        for name in set("XYZ") & set(words):
            k, (adds, value) = "XYZ".index(name), words[name]
            end[k] = value * self.unit + (start[k] if adds else 0.0)
            step[k] = value * self.unit if adds else 0.0
        if head == "CC":
            self.pole = end
            return
        if "M128" in line:
            self._lead(True)
        if head in ("LP", "CP"):
            end = self._polar(head, start, end, words)
        self._turn(head, words, step)
        if head in ("C", "CR"):
            self._arc(head, line, start, end, T)
        here = (T @ np.append(end, 1.0))[:3]
        if "M91" in line:
            given = [name in words for name in "XYZ"]
            here = np.where(given, end + np.array([500.0, -300.0, 700.0]), self.here)
        self.here = here
        target = None if head in ("CP", "DEP", "APPR") else self._pose(here)
        flat = head in ("C", "CR")
        whole = head == "L" and self.tip and not self.by_axis
        axial = head == "LN" and "TX" in words and self.tip
        self._emit(
            target, via=not (whole or axial), follows=bool(step.any()), step=step,
            told=(2,) if axial else (0, 1, 2), within=self.side[:2] if flat else (0, 1, 2),
        )  # fmt: skip
        if "M129" in line:
            self._lead(False)
        if "M99" in line:
            self._lose()

    def _turn(self, head: str, words: Words, step: np.ndarray) -> None:
        if (head != "L" and set("ABC") & set(words)) or (head != "LN" and "TX" in words):
            raise Ended  # the control takes no such block
        if "TX" in words:
            axis = np.array([words[name][1] for name in ("TX", "TY", "TZ")])
            if self.tip:
                self.turn, self.by_axis = axis / np.linalg.norm(axis), True
        if set("ABC") & set(words) and self.by_axis:
            self.turn, self.by_axis = self._somewhere() / 4.0, False
        for name in set("ABC") & set(words):
            k, (adds, value) = "ABC".index(name), words[name]
            self.turn[k] = value + (self.turn[k] if adds else 0.0)
            step[3 + k] = value if adds else 0.0

    def _polar(self, head: str, start: np.ndarray, end: np.ndarray, words: Words) -> np.ndarray:
        if self.pole is None:
            raise Ended
        u, v, _ = self.side
        if head == "LP":
            radius, angle = words["PR"][1] * self.unit, words["PA"][1] * DEG
        else:
            across = (start - self.pole)[[u, v]]
            radius = float(np.hypot(*across))
            angle = words["PA"][1] * DEG
            if words["PA"][0]:
                angle += float(np.arctan2(across[1], across[0]))
        out = end.copy()
        out[u] = self.pole[u] + radius * np.cos(angle)
        out[v] = self.pole[v] + radius * np.sin(angle)
        return out

    def _arc(self, head: str, line: str, start: np.ndarray, end: np.ndarray, T: np.ndarray) -> None:
        flat = list(self.side[:2])
        s, e, left = start[flat], end[flat], "DR+" in line
        if head == "C":
            if self.pole is None:
                raise Ended
            w = self.pole[flat]
        else:
            found = re.search(r"\bR([+-][\d.]+)", line)
            assert found, line
            radius, chord = float(found[1]) * self.unit, e - s
            size = float(np.hypot(*chord))
            if size == 0.0 or radius**2 < 0.25 * size**2:
                raise Ended
            away = np.sqrt(radius**2 - 0.25 * size**2) * np.sign(radius) * (1.0 if left else -1.0)
            w = 0.5 * (s + e) + away * np.array([-chord[1], chord[0]]) / size
        a, b = s - w, e - w
        if abs(np.hypot(*a) - np.hypot(*b)) > MISS:
            raise Ended
        turn = np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b) * (1.0 if left else -1.0)
        turn = turn % (2.0 * np.pi) if np.hypot(*(e - s)) > 1e-6 else 2.0 * np.pi
        half = 0.5 * turn * (1.0 if left else -1.0)
        middle = 0.5 * (start + end)
        c, d = np.cos(half), np.sin(half)
        middle[flat] = w + np.array([[c, -d], [d, c]]) @ a
        angle = float(np.arctan2(*(middle[flat] - w)[::-1]))
        arc = Arc((flat[0], flat[1]), w * MM, float(np.hypot(*a)) * MM, angle, half)
        here = (T @ np.append(middle, 1.0))[:3]
        plain = np.array_equal(T, np.eye(4))
        self._emit(self._pose(here), via=True, within=self.side[:2], arc=arc if plain else None)

    def _pose(self, here: np.ndarray) -> np.ndarray:
        T = np.eye(4)
        T[:3, 3] = here * MM
        if self.by_axis:
            z = -self.turn
            x = np.cross([0.0, 1.0, 0.1], z)
            x /= np.linalg.norm(x)
            T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        elif self.tip:
            T[:3, :3] = matrix_from_abc(self.turn[::-1] * DEG)
        else:
            T[:3, :3] = np.diag([1.0, -1.0, -1.0])
        return T

    def _emit(self, target: np.ndarray | None, **more: object) -> None:
        bases, tools = self.frames["base"], self.frames["tool"]
        base = bases.get(self.preset, bases[""])
        self.moves.append(Move(base, tools.get(self.tool, tools[""]), target, **more))
