"""Executes the RAPID of ``rapid_flow_programs``, written without the product.

What a program cannot know (inputs, where the robot is, when a trap comes, whether the operator
begins a cycle anew or moves the pointer to main) is drawn from a seed. Persistents always keep
their values, variables of modules until the pointer is moved to main, variables of routines until
their end.
"""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from controllers import BINARY, COMPARE, MOST_STEPS, Ended, Move, split

from robotrue.core.rotations import matrix_from_quat_wxyz, quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM

MEMBERS = {
    name: place
    for names in (
        "trans rot robconf extax", "x y z", "q1 q2 q3 q4", "robhold tframe tload",
        "_ ufprog ufmec uframe oframe", "robax", "rax_1 rax_2 rax_3 rax_4 rax_5 rax_6", "at lift",
    )
    for place, name in enumerate(names.split())
}  # fmt: skip
CHANGES = {"incr": 1.0, "decr": -1.0, "clear": 0.0, "add": 0.0}
CLOSING = {"endif": "if", "endfor": "for", "endwhile": "while", "endtest": "test"}
DEEPEST = 12
"""Routines that call each other, one in another."""
UNTURNED = [1.0, 0.0, 0.0, 0.0]
OUTSIDE = {
    "tool0": [True, [[0.0] * 3, UNTURNED], []],
    "wobj0": [False, True, "", [[0.0] * 3, UNTURNED], [[0.0] * 3, UNTURNED]],
}
DECLARED = re.compile(
    r"(local |task )?(const|pers|var) (\w+) (\w+)(?:\{(\d+)\})?(?::=(.*))?$", re.IGNORECASE
)
ASSIGNED = re.compile(r"([a-z]\w*(?:\{[^}]*\})?(?:\.\w+)*):=(.*)$")
ROUTINE = re.compile(r"(?:local )?(proc|func|trap) (?:(?:robtarget|num|pose) )?(\w+)(?:\((.*)\))?$")


class Reference(NamedTuple):
    """What a parameter by reference means: a table or list, and the key there."""

    table: Any
    key: Any


class Routine(NamedTuple):
    """Its module, parameters with whether each is a reference, and lines."""

    module: str
    parameters: list[tuple[str, bool]]
    first: int
    end: int
    handler: tuple[int, int] = (0, 0)


class Handled(Exception):
    """Ends a handler: with ``retry`` or ``trynext``."""


class Restarted(Exception):
    """Ends the cycle, with ``exit`` or ``exitcycle``."""


class Failed(Exception):
    """An error that no routine has handled yet."""


class Returned(Exception):
    """Ends a routine, with the value of a function."""


def pose_of(value: Any) -> np.ndarray:
    """The pose (4, 4), m, of a pose or robtarget."""
    T = np.eye(4)
    T[:3, 3], quaternion = np.array(value[0]) * MM, np.array(value[1])
    T[:3, :3] = matrix_from_quat_wxyz(quaternion / np.linalg.norm(quaternion))
    return T


def _printed(T: np.ndarray) -> list[list[float]]:
    return [(T[:3, 3] / MM).tolist(), quat_wxyz_from_matrix(T[:3, :3]).tolist()]


def _python(text: str) -> str:
    """An expression as Python spells it."""
    text = re.sub(r"(?<![:<>])=", "==", text.replace("<>", "!=")).replace("!==", "!=")
    text = re.sub(r"\\(\w+):==?", r",\1=", text).replace("(,", "(")
    return text.replace("{", "[").replace("}", "]").strip()


class RapidController:
    """The modules of one task.

    Args:
        files: Texts by name.
        rng: Decides what the program cannot know.
    """

    def __init__(self, files: Mapping[str, str], rng: np.random.Generator) -> None:
        self.rng = rng
        self.lines: list[str] = []
        self.routines: dict[str, Routine] = {}
        self.data: dict[str, dict[str, Any]] = {"": copy.deepcopy(OUTSIDE)}
        self.moves: list[Move] = []
        self.starts: list[tuple[str, str]] = []
        self.names: dict[str, str] = {}
        self.ended, self.depth = "", 0
        for name, text in files.items():
            self._load(name, text)
        for module, line in self.starts:
            self._declare(line, self.data[module], module)

    def _load(self, module: str, text: str) -> None:
        self.data[module] = {}
        routine, in_record = "", False
        for given in text.splitlines():
            line = given.strip().removesuffix(";").lower()
            match = ROUTINE.match(line)
            if match:
                routine, parameters, first = match[2], match[3] or "", len(self.lines)
            elif line in ("endproc", "endfunc", "endtrap"):
                pairs = [each.split() for each in parameters.split(",") if each.strip()]
                names = [(each[-1], each[0] in ("inout", "var", "pers")) for each in pairs]
                end = len(self.lines)
                fails = "error" in self.lines[first:]
                error = self.lines.index("error", first) if fails else end
                self.routines[routine] = Routine(module, names, first, error, (error + 1, end))
                routine = ""
            elif routine:
                self.lines.append(line)
            elif line.startswith(("record", "endrecord")):
                in_record = line.startswith("record")
            elif declared := DECLARED.match(line):
                local = declared[1] == "local "
                self.starts.append((module if local else "", line))
            else:
                assert in_record or not line or "module" in line, line

    def run(self) -> bool:
        """Runs main; returns whether it came to its end."""
        moved = {"exit": True, "exitcycle": False}.get(self.ended, self.rng.random() < 0.5)
        if moved:  # the pointer is moved to main
            for module, line in self.starts:
                if " var " in f" {line}":
                    self._declare(line, self.data[module], module)
            self.shift, self.traps = np.eye(4), {}
        self.__dict__.setdefault("shift", np.eye(4))
        self.__dict__.setdefault("traps", {})
        self.trapped, self.steps, self.handlers, self.ended = False, 0, 0, ""
        try:
            self._call("main", [])
        except Restarted as way:
            self.ended = str(way)
        except Ended:
            return False
        return True

    # Values

    def _declare(self, line: str, table: dict[str, Any], module: str) -> None:
        match = DECLARED.match(line)
        assert match, line
        kind, name, size, text = match[3], match[4], match[5], match[6]
        scope = (table, module)
        empty = {"num": 0.0, "bool": False, "pose": [[0.0] * 3, UNTURNED]}.get(
            kind, [[0.0] * 3, UNTURNED, [0] * 4, [9e9] * 6]
        )
        if text is not None:
            table[name] = copy.deepcopy(self.value(text, scope))
        else:
            table[name] = copy.deepcopy([empty] * int(size) if size else empty)

    def _table(self, name: str, scope: tuple[dict[str, Any], str]) -> dict[str, Any]:
        local, module = scope
        for table in (local, self.data[module], self.data[""]):
            if name in table:
                return table
        raise AssertionError(name)

    def _place(self, node: ast.expr, scope: tuple[dict[str, Any], str]) -> Reference:
        """The table or list that holds a variable or a part of one, and the key there."""
        if isinstance(node, ast.Name):
            table = self._table(node.id, scope)
            held = table[node.id]
            return held if isinstance(held, Reference) else Reference(table, node.id)
        assert isinstance(node, (ast.Subscript, ast.Attribute)), ast.dump(node)
        whole = self._place(node.value, scope)
        if isinstance(node, ast.Attribute):
            return Reference(whole.table[whole.key], MEMBERS[node.attr])
        index = int(self._compute(node.slice, scope)) - 1
        if not 0 <= index < len(whole.table[whole.key]):
            raise Ended
        return Reference(whole.table[whole.key], index)

    def value(self, text: str, scope: tuple[dict[str, Any], str]) -> Any:
        """The value of an expression; a structure is not a copy."""
        return self._compute(ast.parse(_python(text), mode="eval").body, scope)

    def _compute(self, node: ast.expr, scope: tuple[dict[str, Any], str]) -> Any:
        if isinstance(node, ast.Constant):
            return node.value if isinstance(node.value, (str, bool)) else float(node.value)
        if isinstance(node, ast.List):
            return [self._compute(each, scope) for each in node.elts]
        if isinstance(node, ast.UnaryOp):
            value = self._compute(node.operand, scope)
            return not value if isinstance(node.op, ast.Not) else -value
        if isinstance(node, ast.BinOp):
            left, right = (self._compute(each, scope) for each in (node.left, node.right))
            if isinstance(left, list) or isinstance(right, list):  # pos
                return BINARY[type(node.op)](np.array(left), np.array(right)).tolist()
            return BINARY[type(node.op)](left, right)
        if isinstance(node, ast.BoolOp):  # the second one is computed only where it decides
            left = self._compute(node.values[0], scope)
            decided = bool(left) == isinstance(node.op, ast.Or)
            return left if decided else self._compute(node.values[1], scope)
        if isinstance(node, ast.Compare):
            left, right = (self._compute(x, scope) for x in (node.left, node.comparators[0]))
            return COMPARE[type(node.ops[0])](left, right)
        if isinstance(node, ast.Call):
            return self._function(node, scope)
        if isinstance(node, ast.Name) and node.id in ("true", "false"):
            return node.id == "true"
        if isinstance(node, ast.Name) and re.match(r"di\d", node.id):
            return float(self.rng.random() < 0.5)
        if isinstance(node, ast.Name) and re.match(r"ai\d", node.id):
            return float(self.rng.uniform(-50.0, 50.0))
        place = self._place(node, scope)
        return place.table[place.key]

    def _function(self, node: ast.Call, scope: tuple[dict[str, Any], str]) -> Any:
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name in self.routines:
            return self._call(name, list(node.args), scope)
        values = [copy.deepcopy(self._compute(each, scope)) for each in node.args]
        options = {each.arg: self._compute(each.value, scope) for each in node.keywords}
        if name == "offs":
            values[0][0] = [a + b for a, b in zip(values[0][0], values[1:], strict=True)]
            return values[0]
        if name == "reltool":
            T, angle = pose_of(values[0]), 0.5 * DEG * options.get("rz", 0.0)
            turn = [np.cos(angle), 0.0, 0.0, np.sin(angle)]
            return [*_printed(T @ pose_of([values[1:], turn])), *values[0][2:]]
        if name == "posemult":
            return _printed(pose_of(values[0]) @ pose_of(values[1]))
        assert name == "crobt", name
        place, turn = self.rng.uniform(-900.0, 900.0, 3), self.rng.normal(size=4)
        return [place.tolist(), (turn / np.linalg.norm(turn)).tolist(), [0] * 4, [9e9] * 6]

    def _frames(self, work: Any, tool: Any) -> tuple[np.ndarray, np.ndarray]:
        """The frames of targets (in the displaced object) and of the tool."""
        return pose_of(work[3]) @ pose_of(work[4]) @ self.shift, pose_of(tool[1])

    # Statements

    def _call(self, name: str, arguments: list[ast.expr], scope: Any = None) -> Any:
        routine = self.routines[name]
        local: dict[str, Any] = {}
        for (parameter, refers), node in zip(routine.parameters, arguments, strict=True):
            if refers:
                local[parameter] = self._place(node, scope)
            else:
                local[parameter] = copy.deepcopy(self._compute(node, scope))
        self.depth += 1
        if self.depth > DEEPEST:
            raise Ended
        try:
            self._block(routine, (local, routine.module))
        except Returned as returned:
            return returned.args[0]
        finally:
            self.depth -= 1
        return None

    def _try(self, line: str, routine: Routine, scope: Any) -> bool:
        """Executes a statement; returns whether the next one follows, not the same again.

        A motion may fail, before it or at its end, where its own routine has a handler or one that
        called it.
        """
        first, end = routine.handler
        known = self.handlers
        self.handlers = known + (first < end)
        fails = line.startswith("move") and self.handlers > 0 and self.rng.random() < 0.1
        try:
            if not (fails and self.rng.random() < 0.5):
                self._act(line, scope)
            if not fails:
                return True
        except Failed:
            pass
        finally:
            self.handlers = known
        if first >= end:
            raise Failed
        self.handlers = 0  # an error in a handler stops the program
        try:
            self._block(routine._replace(first=first, end=end, handler=(0, 0)), scope)
        except Handled as way:
            return str(way) == "trynext"
        finally:
            self.handlers = known
        raise Returned(None)

    def _block(self, routine: Routine, scope: tuple[dict[str, Any], str]) -> None:
        partner, others = self._structure(routine)
        last: dict[int, tuple[float, Any]] = {}
        at = routine.first
        while at < routine.end:
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise Ended
            self._interrupt()
            line = self.lines[at]
            word = line.partition(" ")[0]
            if line.startswith("goto "):
                at = self.lines.index(line.split()[1] + ":", routine.first, routine.end)
            elif line.startswith("if ") and not line.endswith(" then"):
                match = re.match(r"if (.*?\)|.*?=\d) (.*)$", line)
                assert match, line
                if self.value(match[1], scope):
                    if match[2].startswith("goto "):
                        label = match[2].split()[1] + ":"
                        at = self.lines.index(label, routine.first, routine.end)
                        continue
                    at += self._try(match[2], routine, scope)
                    continue
                at += 1
            elif word in ("else", "elseif", "case", "default:"):  # reached from above: go on behind
                at = partner[max(s for s, places in others.items() if at in places)] + 1
            elif word in ("if", "test"):
                at = self._choose(at, [*others[at], partner[at]], scope)
            elif word == "while":
                whole = self.value(line[6:].removesuffix(" do"), scope)
                at = at + 1 if whole else partner[at] + 1
            elif word == "endwhile":
                at = partner[at]
            elif word in ("for", "endfor"):
                at = self._count(at, partner, last, scope)
            elif word not in CLOSING:
                at += self._try(line, routine, scope)
            else:
                at += 1

    def _structure(self, routine: Routine) -> tuple[dict[int, int], dict[int, list[int]]]:
        """The other end of every structure, and the alternatives in it."""
        opened: list[int] = []
        partner: dict[int, int] = {}
        others: dict[int, list[int]] = {}
        for at in range(routine.first, routine.end):
            line = self.lines[at]
            word = line.partition(" ")[0]
            if word in ("for", "while", "test") or (word == "if" and line.endswith(" then")):
                opened.append(at)
                others[at] = []
            elif word in ("else", "elseif", "case", "default:"):
                others[opened[-1]].append(at)
            elif word in CLOSING:
                start = opened.pop()
                partner[start], partner[at] = at, start
        return partner, others

    def _choose(self, at: int, others: list[int], scope: Any) -> int:
        """The line behind the alternative that is taken, or the end of the structure."""
        line = self.lines[at]
        if line.startswith("if "):
            if self.value(line[3:].removesuffix(" then"), scope):
                return at + 1
        else:
            value = self.value(line[5:], scope)
        for other in others[:-1]:
            text = self.lines[other]
            if text in ("else", "default:"):
                return other + 1
            if text.startswith("elseif ") and self.value(text[7:].removesuffix(" then"), scope):
                return other + 1
            if text.startswith("case ") and value in map(float, text[5:-1].split(",")):
                return other + 1
        return others[-1] + 1

    def _count(self, at: int, partner: dict[int, int], last: Any, scope: Any) -> int:
        """The loop variable is one of the loop alone, and hides others of its name."""
        start = min(at, partner[at])
        match = re.match(r"for (\w+) from (.*) to (\S+)(?: step (\S+))? do$", self.lines[start])
        assert match
        local, name = scope[0], match[1]
        if at == start:
            first, to = (self.value(text, scope) for text in (match[2], match[3]))
            last[start] = to, local.get(name)
            local[name] = first
        else:
            local[name] += float(match[4] or 1)
        step, left = float(match[4] or 1), last[start][0] - local[name]
        if left * step >= 0:
            return start + 1
        hidden = last[start][1]
        del local[name]
        if hidden is not None:
            local[name] = hidden
        return partner[start] + 1

    def _interrupt(self) -> None:
        for trap in list(self.traps.values()):
            if self.rng.random() < 0.12 and not self.trapped:
                known, self.handlers, self.trapped = self.handlers, 0, True
                self._call(trap, [])
                self.handlers, self.trapped = known, False

    def _act(self, line: str, scope: tuple[dict[str, Any], str]) -> None:
        word, _, rest = line.partition(" ")
        if word in ("movel", "movej", "movec", "moveabsj"):
            self._move(word, rest, scope)
        elif DECLARED.match(line):
            self._declare(line, *scope)
        elif word == "pdispset":
            self.shift = pose_of(self.value(rest, scope))
        elif word == "pdispoff":
            self.shift = np.eye(4)
        elif word == "pdispon":
            self._displace(rest, scope)
        elif word in ("retry", "trynext"):
            raise Handled(word)
        elif word in ("exit", "exitcycle"):
            raise Restarted(word)
        elif word == "return":
            raise Returned(copy.deepcopy(self.value(rest, scope)) if rest else None)
        elif word == "connect":
            number, _, trap = rest.partition(" with ")
            self.names[number] = trap
        elif word == "isignaldi":
            number = rest.rsplit(",", 1)[1]
            self.traps[number] = self.names[number]
        elif word == "idelete":
            self.traps.pop(rest, None)
        elif word in CHANGES:
            name, *more = split(rest, ",")
            place = self._place(ast.parse(_python(name), mode="eval").body, scope)
            step = self.value(more[0], scope) if more else CHANGES[word]
            place.table[place.key] = step + (place.table[place.key] if word != "clear" else 0.0)
        elif match := ASSIGNED.match(line):
            value = copy.deepcopy(self.value(match[2], scope))
            place = self._place(ast.parse(_python(match[1]), mode="eval").body, scope)
            place.table[place.key] = value
        elif line.startswith("%"):
            self._call(str(self.value(line.strip("%"), scope)), [], scope)
        elif word in self.routines:
            nodes = [
                ast.parse(_python(each), mode="eval").body for each in split(rest, ",") if rest
            ]
            self._call(word, nodes, scope)
        else:
            assert word in ("eoffsset", "eoffsoff", "tpwrite", "") or line.endswith(":"), line

    def _displace(self, rest: str, scope: Any) -> None:
        """From a programmed target to another, in place or in place and attitude."""
        match = re.match(r"(\\rot)?\\exep:=(\w+),(\w+),", rest)
        assert match, rest
        there, given = (self.value(each, scope) for each in match.groups()[1:])
        if match[1]:
            self.shift = pose_of(there) @ np.linalg.inv(pose_of(given))
        else:
            self.shift = pose_of([np.subtract(there[0], given[0]), UNTURNED])

    def _move(self, word: str, rest: str, scope: tuple[dict[str, Any], str]) -> None:
        parts = split(rest, ",")
        tool, *options = parts[-1].split("\\")
        work = next((each[6:] for each in options if each.startswith("wobj:=")), "wobj0")
        base, T_tool = self._frames(self.value(work, scope), self.value(tool, scope))
        if word == "moveabsj":
            axes = np.array(self.value(parts[0], scope)[0]) * DEG
            self.moves.append(Move(np.eye(4), T_tool, axes, via=False))
            return
        for number in range(2 if word == "movec" else 1):
            text = parts[number]
            self.moves.append(
                Move(
                    base, T_tool, pose_of(self.value(text, scope)),
                    via=word == "movec" and number == 0, follows=text.startswith(("offs", "relt")),
                )
            )  # fmt: skip
