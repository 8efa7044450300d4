"""An interpreter of the KRL and RAPID that our correction modules are written in.

Written without the product: it knows assignments, IF, FOR, RETURN, arrays, components and the few
functions that are used. Numbers with a fraction have 32 bits after every operation, as REAL and num
have. A statement, a name or an operator that it does not know is an error.
"""

from __future__ import annotations

import copy
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

TOKEN = re.compile(
    r'\s*("[^"]*"|\d+\.?\d*(?:E[-+]?\d+)?|[#$]?[A-Z_]\w*|:=|<>|<=|>=|==|[-+*/:<>=(),.\[\]{}\\])',
    re.IGNORECASE,
)
FLOAT = np.float32
FRAME = ("x", "y", "z", "a", "b", "c")


class Returned(Exception):
    """Carries the value of RETURN out of nested blocks."""

    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


@dataclass
class Routine:
    parameters: list[str]
    lines: list[list[str]]


@dataclass
class Controller:
    """Variables and routines of modules, and what a program did besides computing.

    Attributes:
        rapid: Language; KRL otherwise.
        values: Global variables by name in lower case.
        whole: Names of whole numbers, which round what they are given.
        routines: By name in lower case.
        stops: How often the program was halted.
    """

    rapid: bool
    values: dict[str, Any] = field(default_factory=dict)
    whole: set[str] = field(default_factory=set)
    routines: dict[str, Routine] = field(default_factory=dict)
    stops: int = 0

    def load(self, text: str) -> None:
        """Takes a module; comments of whole lines only."""
        marks = "!" if self.rapid else (";", "&")
        lines = [line.strip() for line in text.splitlines()]
        lines = [line for line in lines if line and not line.startswith(marks)]
        assert max(map(len, lines), default=0) < 160
        if self.rapid:
            lines = list(_join_rapid(lines))
        routine: Routine | None = None
        for line in lines:
            head = re.match(r"(?:GLOBAL )?(?:DEFFCT|FUNC) \w+ (\w+)\((.*)\)$", line)
            if head:
                names = re.findall(r"(\w+)(?::IN|(?=\\)|$)", head[2])
                routine = Routine([name.lower() for name in names], [])
                self.routines[head[1].lower()] = routine
            elif line in ("ENDFCT", "ENDFUNC"):
                routine = None
            elif routine is not None:
                routine.lines.append(_tokens(line))
            elif not re.match(r"(DEFDAT|ENDDAT|MODULE|ENDMODULE)\b", line):
                self._declare(line, self.values)

    def _declare(self, line: str, into: dict[str, Any]) -> None:
        """Reads a declaration, or the value of an element in a data list."""
        if self.rapid:
            match = re.match(
                r"(?:LOCAL )?(?:CONST|PERS|VAR) (\w+) (\w+)(\{.*?\})?(?::=(.*))?$", line
            )
            assert match, line
            kind, name, size, value = match.groups()
            into[name.lower()] = _rapid_value(kind, size, value)
            return
        match = re.match(r"DECL (?:GLOBAL )?(\w+) (.*)$", line)
        if match is None:
            element = re.match(r"(\w+)\[([\d,]+)\]=(-?[\d.]+)$", line)
            assert element, line
            place = tuple(int(n) - 1 for n in element[2].split(","))
            into[element[1].lower()][place] = FLOAT(element[3])
            return
        kind = match[1].upper()
        for name, size, value in re.findall(
            r"(\w+)(\[[\d,]+\])?(?:=(\{.*\}|[^,]+))?(?:,|$)", match[2]
        ):
            key = name.lower()
            assert len(name) <= 24
            if kind == "INT":
                self.whole.add(key)
            if key not in into or value:
                into[key] = _krl_value(kind, size, value)

    def call(self, name: str, *given: Any, **optional: Any) -> Any:
        """Returns what a routine returns."""
        routine = self.routines[name.lower()]
        local = {key: None for key in routine.parameters}
        local |= dict(zip(routine.parameters, copy.deepcopy(given), strict=False))
        local |= {key.lower(): value for key, value in optional.items()}
        try:
            _Run(self, local, routine.lines).block(0, len(routine.lines))
        except Returned as returned:
            return returned.value
        raise AssertionError(f"{name} returns nothing")


@dataclass
class _Run:
    controller: Controller
    local: dict[str, Any]
    lines: list[list[str]]

    def block(self, start: int, end: int) -> None:
        at = start
        while at < end:
            words = self.lines[at]
            key = words[0].upper()
            if key == "IF":
                stop = self._end_of(at, "IF", "ENDIF")
                assert words[-1].upper() == "THEN"
                if self.value(words[1:-1]):
                    self.block(at + 1, stop)
                at = stop
            elif key == "FOR":
                stop = self._end_of(at, "FOR", "ENDFOR")
                for number in self._range(words):
                    self.local[words[1].lower()] = number
                    self.block(at + 1, stop)
                at = stop
            else:
                self._simple(key, words)
            at += 1

    def _simple(self, key: str, words: list[str]) -> None:
        if key in ("DECL", "VAR"):
            line = " ".join(words).replace(" [ ", "[").replace(" ]", "]").replace(" { ", "{")
            line = line.replace(" }", "}").replace(" , ", ",")
            self.controller._declare(line, self.local)
        elif key == "RETURN":
            raise Returned(self.value(words[1:]))
        elif key in ("HALT", "STOP"):
            self.controller.stops += 1
        elif key != "TPWRITE":
            sign = ":=" if self.controller.rapid else "="
            at = words.index(sign)
            self.assign(words[:at], self.value(words[at + 1 :]))

    def _range(self, words: list[str]) -> range:
        middle = [word.upper() for word in words].index("TO")
        assert words[2].upper() == ("FROM" if self.controller.rapid else "=")
        last = words[middle + 1 : -1] if self.controller.rapid else words[middle + 1 :]
        return range(int(self.value(words[3:middle])), int(self.value(last)) + 1)

    def _end_of(self, at: int, opening: str, closing: str) -> int:
        depth = 0
        for k in range(at, len(self.lines)):
            depth += (self.lines[k][0].upper() == opening) - (self.lines[k][0].upper() == closing)
            if depth == 0:
                return k
        raise AssertionError(f"no {closing}")

    def scope(self, name: str) -> dict[str, Any]:
        return self.local if name in self.local else self.controller.values

    def assign(self, words: list[str], value: Any) -> None:
        name = words[0].lower()
        scope = self.scope(name)
        assert name in scope, f"{name} is not declared"
        if isinstance(value, (float, np.floating)):
            value = FLOAT(value)
            if name in self.controller.whole:
                value = math.floor(float(value) + 0.5)
        if len(words) == 1:
            scope[name] = copy.deepcopy(value)
            return
        if words[1] in "[{":
            indices = _Expression(self, words[2:-1]).list_until_end()
            scope[name][tuple(int(n) - 1 for n in indices)] = value
            return
        parts = [word.lower() for word in words[2::2]]
        target = scope[name]
        for part in parts[:-1]:
            target = target[part]
        target[parts[-1]] = copy.deepcopy(value)

    def value(self, words: list[str]) -> Any:
        expression = _Expression(self, words)
        result = expression.either()
        assert expression.at == len(words), words[expression.at :]
        return result


@dataclass
class _Expression:
    run: _Run
    words: list[str]
    at: int = 0

    def peek(self) -> str:
        return self.words[self.at].upper() if self.at < len(self.words) else ""

    def take(self, *allowed: str) -> str:
        word = self.peek()
        if word in allowed:
            self.at += 1
            return word
        return ""

    def list_until_end(self) -> list[Any]:
        values = [self.either()]
        while self.take(","):
            values.append(self.either())
        assert self.at == len(self.words)
        return values

    def either(self) -> Any:
        left = self.both()
        while self.take("OR"):
            right = self.both()
            left = left or right
        return left

    def both(self) -> Any:
        left = self.negated()
        while self.take("AND"):
            right = self.negated()
            left = left and right
        return left

    def negated(self) -> Any:
        return not self.negated() if self.take("NOT") else self.compared()

    def compared(self) -> Any:
        left = self.sum()
        equal = "=" if self.run.controller.rapid else "=="
        while operator := self.take("<", ">", "<>", "<=", ">=", equal):
            right = self.sum()
            compare: Mapping[str, Callable[[Any, Any], bool]] = {
                "<": lambda a, b: a < b, ">": lambda a, b: a > b, "<>": lambda a, b: a != b,
                "<=": lambda a, b: a <= b, ">=": lambda a, b: a >= b, equal: lambda a, b: a == b,
            }  # fmt: skip
            left = bool(compare[operator](left, right))
        return left

    def sum(self) -> Any:
        left = self.product()
        while operator := self.take("+", "-"):
            right = self.product()
            left = _short(left + right if operator == "+" else left - right)
        return left

    def product(self) -> Any:
        left = self.signed()
        while operator := self.take("*", "/"):
            right = self.signed()
            assert operator == "*" or not isinstance(right, int)
            left = _short(left * right if operator == "*" else left / right)
        return left

    def signed(self) -> Any:
        if self.take("-"):
            return _short(-self.signed())
        left = self.primary()
        while self.take(":"):
            assert not self.run.controller.rapid
            left = join_frames(left, self.primary())
        return left

    def primary(self) -> Any:
        word = self.words[self.at]
        self.at += 1
        if word == "(":
            inner = self.either()
            assert self.take(")")
            return inner
        if word[0].isdigit():
            whole = "." not in word and not self.run.controller.rapid
            return int(word) if whole else FLOAT(word)
        if word[0] == "#":
            return word.upper()
        if self.take("("):
            return self._call(word.lower())
        name = word.lower()
        scope = self.run.scope(name)
        assert name in scope, f"{name} is not known"
        value = scope[name]
        if self.take("[", "{"):
            indices = [int(self.either())]
            while self.take(","):
                indices.append(int(self.either()))
            assert self.take("]", "}")
            assert min(indices) >= 1
            value = value[tuple(n - 1 for n in indices)]
            value = int(value) if name in self.run.controller.whole else value
        while self.take("."):
            value = value[self.words[self.at].lower()]
            self.at += 1
        return value

    def _call(self, name: str) -> Any:
        switch = ""
        if self.take("\\"):
            switch = self.words[self.at].lower()
            self.at += 1
            assert self.take(",")
        if name == "present":
            value = self.run.local[self.words[self.at].lower()] is not None
            self.at += 1
            assert self.take(")")
            return value
        given = [self.either()]
        while self.take(","):
            given.append(self.either())
        assert self.take(")")
        if name in self.run.controller.routines:
            return self.run.controller.call(name, *given)
        builtin: Mapping[str, Callable[..., Any]] = {
            "abs": lambda x: _short(abs(x)),
            "sin": lambda x: FLOAT(math.sin(math.radians(float(x)))),
            "cos": lambda x: FLOAT(math.cos(math.radians(float(x)))),
            **(_rapid_functions(switch) if self.run.controller.rapid else {}),
        }
        return builtin[name](*given)


def _rapid_functions(switch: str) -> dict[str, Callable[..., Any]]:
    return {
        "trunc": lambda x: FLOAT(math.trunc(float(x))),
        "posemult": multiply_poses,
        "norient": lambda q: _quat(_numbers(q) / np.linalg.norm(_numbers(q))),
        "eulerzyx": lambda q: FLOAT(_euler(quat_matrix(_numbers(q)))["zyx".index(switch)]),
    }


def _tokens(line: str) -> list[str]:
    words, at = [], 0
    line = line.rstrip(" ;")
    while at < len(line):
        match = TOKEN.match(line, at)
        assert match, line[at:]
        words.append(match[1])
        at = match.end()
    return words


def _join_rapid(lines: list[str]) -> Iterator[str]:
    """Yields statements: they end with ``;``, or are lines of their own."""
    held = ""
    for line in lines:
        alone = re.match(r"(MODULE|ENDMODULE|FUNC|ENDFUNC|IF|ENDIF|FOR|ENDFOR)\b", line)
        if alone and not held:
            yield line
            continue
        held += line
        if held.endswith(";"):
            yield held[:-1]
            held = ""
    assert not held


def _short(value: Any) -> Any:
    return value if isinstance(value, (int, bool)) else FLOAT(value)


def _krl_value(kind: str, size: str, value: str) -> Any:
    if size:
        return np.zeros([int(n) for n in size[1:-1].split(",")], FLOAT)
    if kind in ("FRAME", "E6POS", "POS"):
        stated = dict(re.findall(r"([A-Z]) (-?[\d.]+)", value))
        return {letter: FLOAT(stated.get(letter.upper(), 0.0)) for letter in FRAME}
    if kind == "BOOL":
        return value == "TRUE"
    return int(value or 0) if kind == "INT" else FLOAT(value or 0)


def _rapid_value(kind: str, size: str | None, value: str | None) -> Any:
    if kind == "bool":
        return value == "TRUE"
    if kind == "pose":
        numbers = re.findall(r"-?[\d.]+", value or "") or [0, 0, 0, 1, 0, 0, 0]
        return rapid_pose(np.array(numbers, dtype=FLOAT))
    assert kind == "num", kind
    if size is None:
        return FLOAT(value or 0)
    shape = [int(n) for n in size[1:-1].split(",")]
    if value is None:
        return np.zeros(shape, FLOAT)
    nested = np.array(json.loads(value), dtype=FLOAT)
    assert list(nested.shape) == shape
    return nested


def krl_matrix(frame: Mapping[str, Any]) -> np.ndarray:
    """(4, 4) float32 of X, Y, Z, A, B, C; mm."""
    a, b, c = (np.radians(float(frame[k])) for k in "abc")
    ca, sa, cb, sb, cc, sc = (f(v) for v in (a, b, c) for f in (np.cos, np.sin))
    T = np.eye(4)
    T[:3, :3] = [
        [ca * cb, ca * sb * sc - sa * cc, ca * sb * cc + sa * sc],
        [sa * cb, sa * sb * sc + ca * cc, sa * sb * cc - ca * sc],
        [-sb, cb * sc, cb * cc],
    ]
    T[:3, 3] = [frame[k] for k in "xyz"]
    return T.astype(FLOAT)


def krl_frame(T: np.ndarray) -> dict[str, Any]:
    """The components of a frame, float32."""
    return dict(zip(FRAME, map(FLOAT, [*T[:3, 3], *_euler(T[:3, :3])]), strict=True))


def join_frames(left: Mapping[str, Any], right: Mapping[str, Any]) -> dict[str, Any]:
    """The geometric operator, computed with 32 bits."""
    return krl_frame(krl_matrix(left) @ krl_matrix(right))


def _euler(R: np.ndarray) -> list[float]:
    """A, B, C in deg of Rz(A) Ry(B) Rx(C)."""
    R = R.astype(float)
    return [
        math.degrees(math.atan2(R[1, 0], R[0, 0])),
        math.degrees(math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))),
        math.degrees(math.atan2(R[2, 1], R[2, 2])),
    ]


def rapid_pose(numbers: np.ndarray) -> dict[str, Any]:
    """x, y, z, q1 .. q4 as a pose, float32."""
    trans = dict(zip("xyz", map(FLOAT, numbers[:3]), strict=True))
    return {"trans": trans, "rot": _quat(numbers[3:])}


def _quat(numbers: np.ndarray) -> dict[str, Any]:
    return dict(zip(("q1", "q2", "q3", "q4"), map(FLOAT, numbers), strict=True))


def _numbers(q: Mapping[str, Any]) -> np.ndarray:
    return np.array([q[k] for k in ("q1", "q2", "q3", "q4")], dtype=FLOAT)


def quat_matrix(q: np.ndarray) -> np.ndarray:
    """(3, 3) of a unit quaternion w, x, y, z."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def multiply_poses(left: Mapping[str, Any], right: Mapping[str, Any]) -> dict[str, Any]:
    """PoseMult, computed with 32 bits."""
    p, q = _numbers(left["rot"]), _numbers(right["rot"])
    R = quat_matrix(p)
    place = [np.array([t["trans"][k] for k in "xyz"], dtype=FLOAT) for t in (left, right)]
    w = p[0] * q[0] - p[1:] @ q[1:]
    v = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return rapid_pose(np.concatenate([place[0] + R @ place[1], [w], v]).astype(FLOAT))
