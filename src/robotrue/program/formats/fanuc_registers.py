"""Registers of a Fanuc LS program at its moves, over all control-flow paths.

A block is a run of statements without a label, a jump or a branch. A value is known at the start of
a block where all paths to it agree; the blocks are gone through until nothing changes any more. A
statement that is not understood takes away the knowledge of every register it names, a program that
is called that of all it may set.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from robotrue.program.formats.fanuc_scan import find_program, list_statements
from robotrue.program.formats.fanuc_values import (
    OffsetCondition,
    RegisterPose,
    State,
    Value,
    number_of,
    pose_of,
)

Statement = tuple[int, bytes]
"""First byte, and text without its line number and semicolon."""
Effects = Mapping[str, frozenset[str] | None]
"""Names that a program sets, by its name in lower case; None for all."""
_ASSIGNED: Final = re.compile(
    rb"(PR|R)\[[ \t]*(\d{1,6})[ \t]*(?::[^\],]*)?(?:,[ \t]*([1-6])[ \t]*(?::[^\]]*)?)?\][ \t]*="
    rb"(?!=)(.*)",
    re.DOTALL,
)
_FRAME_NUMBER: Final = re.compile(rb"(UFRAME|UTOOL)_NUM[ \t]*=(.*)", re.DOTALL)
_CONDITION: Final = re.compile(
    rb"(TOOL_)?OFFSET[ _]+CONDITION[ \t]+PR\[[ \t]*(\d{1,6})[^\]]*\]"
    rb"(?:[ \t]*,[ \t]*U(?:FRAME|TOOL)\[[ \t]*(\d{1,2})[^\]]*\])?[ \t]*",
    re.IGNORECASE,
)
_NAMED: Final = re.compile(rb"\b(PR|R)\[[ \t]*([^\]:,]*)")
_ASSIGNS: Final = re.compile(rb"\b(PR|R)\[([^\]:,;]{0,99}+)[^\]=;]{0,99}+\][ \t]*=(?!=)")
_SETS_FRAME: Final = re.compile(rb"\b(?:UFRAME|UTOOL|BENUTZER|WKZ)_NUM[ \t]*=")
_CALLED: Final = re.compile(rb"\b(?:CALL|RUN|MONITOR)[ \t]+([\w.\-]+)")
_BESIDE: Final = re.compile(rb"\b(?:RUN|MONITOR)[ \t]+([\w.\-]+)")
_LABEL: Final = re.compile(rb"LBL\[[ \t]*(\d{1,6})")
_JUMPS: Final = re.compile(rb"\bLBL\[[ \t]*(\d{1,6}|[^\]]*)")
_FOR: Final = re.compile(rb"FOR[ \t]+R\[[ \t]*(\d{1,6})")
_MOVE: Final = re.compile(rb"[JLCAS]\s+PR?\s*\[")
_QUIET: Final = re.compile(
    rb"(?:[DRASGU][IO]|UO|F|M)\[[^\]]*\][ \t]*=|WAIT[ \t]+[\d.]|PAYLOAD|END$"
)
_MOST: Final = 4_000_000
"""Blocks times names; beyond, nothing is taken as known."""


def effective_statements(data: bytes, first: int, last: int) -> list[Statement]:
    """Returns the statements between two places; comments and remarked ones are excluded."""
    found = ((match.end(2), match[2].lstrip()) for match in list_statements(data, first, last))
    return [
        (end - len(text), text.rstrip())
        for end, text in found
        if text and not text.startswith((b"!", b"//", b"--"))
    ]


def list_effects(files: Sequence[tuple[str, bytes]], harmless: Sequence[str]) -> Effects:
    """Returns what every program sets, itself and by those it calls; ``*`` is all of them.

    Args:
        files: Name and bytes of the programs given.
        harmless: Programs in no given file that set nothing, in lower case.
    """
    own: dict[str, frozenset[str]] = {}
    calls: dict[str, set[str]] = {}
    for _, data in files:
        found = find_program(data)
        if found is None:
            continue
        name, first, last = found
        text = b";".join(text for _, text in effective_statements(data, first, last))
        own[name] = _set_names(text)
        calls[name] = {each.decode("latin-1").lower() for each in _CALLED.findall(text)}
    out: dict[str, frozenset[str] | None] = dict.fromkeys(harmless, frozenset())
    for name in own:
        reached, waiting = {name}, [name]
        while waiting:
            fresh = calls.get(waiting.pop(), set()) - reached
            reached |= fresh
            waiting += fresh
        strangers = reached - own.keys() - set(harmless)
        known = [own[each] for each in reached if each in own]
        out[name] = None if strangers else frozenset().union(*known)
    given = [out[name] for name in own]
    sure = [sets for sets in given if sets is not None]
    out["*"] = frozenset().union(*sure) if len(sure) == len(given) else None
    return out


def _set_names(text: bytes) -> frozenset[str]:
    """Returns the registers that statements may set; ``PR*`` is any position register."""
    out = {_name(*each) for each in _ASSIGNS.findall(text)}
    if _SETS_FRAME.search(text):
        out |= {"UF", "UT"}
    if b"CONDITION" in text.upper():
        out |= {"OFFSET", "TOOL_OFFSET"}
    for line in text.split(b";") if b"R[" in text else ():
        if b"R[" not in line:
            continue
        moves = _MOVE.match(line) is not None
        if not (moves or _ASSIGNED.match(line) or _QUIET.match(line)) or (moves and b"=" in line):
            out |= {_name(*each) for each in _NAMED.findall(line)}
    return frozenset(out)


def _name(kind: bytes, number: bytes) -> str:
    plain = number.strip()
    return kind.decode() + ((plain.lstrip(b"0") or b"0").decode() if plain.isdigit() else "*")


@dataclass(slots=True)
class _Block:
    """Statements that run one after the other, and the blocks that may follow."""

    statements: list[Statement] = field(default_factory=list)
    after: list[int] = field(default_factory=list)
    start: State | None = None


class Registers:
    """The registers of one program.

    Attributes:
        at: Known values at each move that uses them, by the first byte of its statement.
    """

    def __init__(
        self,
        statements: Sequence[Statement],
        points: Mapping[int, RegisterPose],
        start: State,
        effects: Effects,
    ) -> None:
        """Goes through the program.

        Args:
            statements: As :func:`effective_statements` returns them.
            points: Positions that no statement changes, by number.
            start: What is known where the program begins.
            effects: What programs that are called may set.
        """
        self._points, self._effects = points, effects
        self._beside: set[str] = set()
        every = False
        for _, text in statements:
            for called in _BESIDE.findall(text):
                sets = effects.get(called.decode("latin-1").lower())
                every |= sets is None
                self._beside |= sets or set()
        self.at: dict[int, State] = {}
        self._blocks = [] if every else _cut_blocks(statements)
        names = {name for _, text in statements for name in _set_names(text)} | start.keys()
        if self._blocks and len(self._blocks) * len(names) < _MOST:
            self._solve(start)

    def _solve(self, start: State) -> None:
        self._blocks[0].start = self._without(dict(start), self._beside)
        waiting = deque([0])
        while waiting:
            block = self._blocks[waiting.popleft()]
            state = dict(block.start or {})
            for statement in block.statements:
                self._apply(state, statement[1])
            for number in block.after:
                follower = self._blocks[number]
                if follower.start is None:
                    follower.start = dict(state)
                    waiting.append(number)
                    continue
                lost = [k for k, v in follower.start.items() if state.get(k) != v]
                for name in lost:
                    del follower.start[name]
                if lost:
                    waiting.append(number)
        for block in self._blocks:
            state = dict(block.start or {})
            for place, text in block.statements:
                if _MOVE.match(text) and (b"PR" in text or b"FFSET" in text.upper()):
                    self.at[place] = _look_up(state, text)
                self._apply(state, text)

    def _apply(self, state: State, text: bytes) -> None:
        """Changes what is known as a statement does."""
        condition = _CONDITION.fullmatch(text)
        assigned, frame = _ASSIGNED.match(text), _FRAME_NUMBER.match(text)
        if assigned is not None:
            self._assign(state, assigned)
        elif frame is not None:
            value = number_of(frame[2], state)
            self._give(state, "UF" if frame[1] == b"UFRAME" else "UT", value)
        elif condition is not None:
            self._set_condition(state, condition)
        elif not _QUIET.match(text):
            self._without(state, _set_names(text))
        loop = _FOR.match(text)
        if loop is not None:
            state.pop(f"R{int(loop[1])}", None)
        for called in _CALLED.findall(text):
            sets = self._effects.get(called.decode("latin-1").lower())
            if sets is None:
                state.clear()
            else:
                self._without(state, sets)
        self._without(state, self._beside)

    def _assign(self, state: State, match: re.Match[bytes]) -> None:
        kind, number, element, text = match.groups()
        name = f"{kind.decode()}{int(number)}"
        value: Value | None = None
        if kind == b"R":
            value = number_of(text, state)
        elif element is None:
            value = pose_of(text, state, self._points)
        else:
            before, given = state.get(name), number_of(text, state)
            if isinstance(before, RegisterPose) and given is not None:
                value = before.with_element(int(element), given)
        self._give(state, name, value)

    def _set_condition(self, state: State, match: re.Match[bytes]) -> None:
        register, frame = int(match[2]), int(match[3]) if match[3] else -1
        pose, value = state.get(f"PR{register}"), None
        if isinstance(pose, RegisterPose):
            value = OffsetCondition(register, pose, frame)
        self._give(state, "TOOL_OFFSET" if match[1] else "OFFSET", value)

    def _give(self, state: State, name: str, value: Value | None) -> None:
        if value is None:
            state.pop(name, None)
        else:
            state[name] = value

    def _without(self, state: State, names: set[str] | frozenset[str]) -> State:
        for name in names:
            if name.endswith("*"):
                kind = name[:-1]
                for each in [k for k in state if k.rstrip("0123456789") == kind]:
                    del state[each]
            else:
                state.pop(name, None)
        return state


def _look_up(state: State, text: bytes) -> State:
    """Returns the known values of all registers that a move may use."""
    names = [_name(*each) for each in _NAMED.findall(text)]
    for name in ("OFFSET", "TOOL_OFFSET"):
        held = state.get(name)
        names += [name, f"PR{held.register}"] if isinstance(held, OffsetCondition) else []
    return {name: state[name] for name in (*names, "UF", "UT") if name in state}


def _cut_blocks(statements: Sequence[Statement]) -> list[_Block]:
    """Returns the blocks of a program; a branch that cannot be followed leads everywhere."""
    blocks, labels = [_Block()], dict[int, int]()
    jumps: list[tuple[int, bytes]] = []
    opened: list[list[int]] = []  # of IF .. THEN: blocks that go on after it; of FOR: its head

    def begin(*before: int) -> int:
        blocks.append(_Block())
        for each in before:
            blocks[each].after.append(len(blocks) - 1)
        return len(blocks) - 1

    here = 0
    for place, text in statements:
        label = _LABEL.match(text)
        upper = text.upper()
        if label is not None:
            here = begin(here)
            labels[int(label[1])] = here
            continue
        if upper.startswith(b"ENDIF"):
            ends = opened.pop() if opened else []
            here = begin(here, *ends)
        elif upper == b"ELSE":
            head = opened[-1].pop(0) if opened and opened[-1] else here
            if opened:
                opened[-1].append(here)
            here = begin(head)
        elif upper.startswith(b"ENDFOR"):
            head = opened.pop()[0] if opened and opened[-1] else 0
            blocks[here].after.append(head)
            here = begin(head)
        elif upper.startswith(b"FOR"):
            here = begin(here)
            blocks[here].statements.append((place, text))
            opened.append([here])
            here = begin(here)
        elif upper.startswith(b"IF") and upper.endswith(b"THEN"):
            opened.append([here])
            here = begin(here)
        elif upper.startswith((b"IF", b"SELECT", b"=", b"ELSE,")) or _JUMPS.search(text):
            jumps += [(here, each) for each in _JUMPS.findall(text)]
            if upper.startswith((b"JMP", b"ABORT")):
                here = begin()
                continue
            maybe = begin(here)
            blocks[maybe].statements.append((place, text))
            here = begin(here, maybe)
        elif upper in (b"END", b"ABORT"):
            here = begin()
        else:
            blocks[here].statements.append((place, text))
    for block, text in jumps:
        targets = [labels[int(text)]] if text.isdigit() and int(text) in labels else []
        if not text.isdigit():
            targets = list(labels.values())
        for each in targets:
            blocks[block].after.append(each)
            blocks[min(block + 1, len(blocks) - 1)].after.append(each)
    return blocks
