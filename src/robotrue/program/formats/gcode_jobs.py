"""What programs of blocks in one job do to each other: zero offsets, and states at a call."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from robotrue.core.arrays import IntArray
from robotrue.program.formats.gcode_blocks import PROGRAM_NUMBER, Blocks, list_starts
from robotrue.program.formats.gcode_kernels import NO_STATE
from robotrue.program.formats.gcode_state import in_force, stated_column
from robotrue.program.formats.gcode_vocabulary import NAMED, OPEN, UNCERTAIN, Modal
from robotrue.program.formats.numbered_frames import list_changed_frames

Files = Sequence[tuple[str, bytes]]
_OFFSET: Final = re.compile(rb"\bG10[^\r\n]*?\bL(20?)[^\r\n]*?\bP0*(\d{1,3})\b", re.IGNORECASE)
_FRAME: Final = re.compile(rb"\$P_UIFR\s*\[\s*(\d{0,3})", re.IGNORECASE)
_NAMED: Final = re.compile(
    rb"(?im)^[ \t]*(?:0+[ \t]+)?(?:BEGIN[ \t]+PGM|PROC)[ \t]+([\w\-]+)|^%_N_(\w+?)_[MS]PF\b"
)
_MACRO: Final = re.compile(rb"M1?98(?!\d)|G6[56](?!\d)", re.IGNORECASE)
_REPEATED: Final = (
    re.compile(rb"\bMCALL\b|[ \t]P[ \t]*=?[ \t]*[\w(]", re.IGNORECASE),
    re.compile(rb"G66|L[ \t]*\d|P[ \t]*\d{5}", re.IGNORECASE),
)
"""In calls that run a program several times: by its name, and by ``_MACRO``."""


def list_changed_offsets(files: Files) -> list[Mapping[tuple[str, str], str]]:
    """Returns for each program what the others change of the control's zero offsets."""
    own = [list_changed_frames([each], (b"G10", b"$P_UIFR"), list_offsets) for each in files]
    return [
        {key: what for n, each in enumerate(own) if n != k for key, what in each.items()}
        for k in range(len(files))
    ]


def list_offsets(line: bytes) -> list[tuple[str, str]]:
    """Returns side and name of the zero offsets that a block sets."""
    text = line.partition(b";")[0]
    out = []
    for kind, number in _OFFSET.findall(text):
        first = int(number)
        names = range(54, 60) if not first else (53 + first,)
        out += [f"G{n}" for n in names] if kind == b"2" else [f"G54.1 P{first}"]
    for number in _FRAME.findall(text):
        chosen = (int(number),) if number else range(1, 100)
        out += [f"G{53 + n}" if n <= 4 else f"G{500 + n}" for n in chosen]
    return [("base", name) for name in out]


class Call(NamedTuple):
    """A block that may call a program.

    Attributes:
        caller: Its place in the job.
        block: In it.
        moved: The coordinates may be shifted.
        called: Place of the program.
        repeats: It may run several times.
    """

    caller: int
    block: int
    moved: bool
    called: int
    repeats: bool = False


def list_calls(files: Files, found: Sequence[Blocks]) -> list[Call]:
    """Returns which programs of a job may call which others, or begin again (M99)."""
    patterns = [_pattern(*each) for each in files] if len(files) > 1 else []
    out = [
        Call(k, block, moved or _moves_in_turns(blocks), each, _repeats(text))
        for k, blocks in enumerate(found)
        for block, moved in blocks.findings.breaks
        for text in (blocks.data[int(blocks.first[block]) : int(blocks.end[block])],)
        for each, pattern in enumerate(patterns)
        if each != k and pattern.search(text)
    ]
    called = {call.called for call in out}
    return out + [
        Call(k, block, moved, k, repeats=True)
        for k, blocks in enumerate(found)
        for block, moved in blocks.findings.breaks
        if k not in called and block in blocks.findings.rounds
        if block < min(list_starts(blocks.data, blocks.first), default=block + 1)
    ]


def _moves_in_turns(blocks: Blocks) -> bool:
    """Returns whether a shift below a block may be in force there, since the program jumps."""
    return bool(blocks.findings.jumps) and blocks.findings.ever_moved


def _repeats(text: bytes) -> bool:
    """Returns whether a block that calls a program may run it several times."""
    return _REPEATED[_MACRO.search(text) is not None].search(text) is not None


def list_groups(count: int, calls: Sequence[Call]) -> list[int]:
    """Returns a number for each program of a job; of those that call each other the same."""
    out = list(range(count))
    for call in calls:
        one, other = out[call.caller], out[call.called]
        out = [one if each == other else each for each in out]
    return out


def list_shifted_calls(
    files: Files, found: Sequence[Blocks], calls: Sequence[Call]
) -> dict[int, str]:
    """Returns the programs that others call while coordinates are shifted, with a sentence each.

    A program that is called by such a one is called so, too, and one that is called behind a
    program that leaves them shifted.
    """
    leaves = {k for k, each in enumerate(found) if each.findings.moved or _moves_in_turns(each)}
    for _ in files:
        leaves |= {call.caller for call in calls if call.called in leaves}
    behind: dict[int, int] = {}
    for call in calls:
        if call.called in leaves:
            first = 0 if found[call.caller].findings.jumps else call.block + (not call.repeats)
            behind[call.caller] = min(first, behind.get(call.caller, first))
    out: dict[int, str] = {}
    count = -1
    while count != len(out):
        count = len(out)
        for call in calls:
            moved = call.moved or call.block >= behind.get(call.caller, call.block + 1)
            if (moved or call.caller in out) and call.called not in out:
                out[call.called] = (
                    f"{files[call.caller][0]} may call it in line "
                    f"{found[call.caller].line(call.block)} while the coordinates are moved, "
                    "turned or scaled"
                )
    return out


def settle_states(found: Sequence[Blocks], calls: Sequence[Call], *, every: bool) -> None:
    """Makes states behind calls and jumps uncertain, or certain where no other value is ever set.

    That is: by the program, by those it calls, and, unless it sets the state before its first call
    or jump, by those that call it.

    Args:
        found: The programs of a job.
        calls: What they call.
        every: All are uncertain.
    """
    called = {call.called for call in calls if call.called != call.caller}
    lost = [every or _calls_others(blocks, k, calls) for k, blocks in enumerate(found)]
    for group in Modal:
        through = [
            _list_values(blocks, group) | ({UNCERTAIN} if lost[k] else set())
            for k, blocks in enumerate(found)
        ]
        sure = [_states_first(blocks.state[:, group]) for blocks in found]
        entry: list[set[int | str]] = [set() if k in called else {0} for k in range(len(found))]
        for _ in found:
            for call in calls:
                through[call.caller] |= through[call.called]
        for _ in found:
            for call in calls:
                entry[call.called] |= through[call.caller] | entry[call.caller]
        for k, blocks in enumerate(found):
            values = through[k] | (set() if sure[k] else entry[k])
            column = blocks.state[:, group]
            one = len(values) == 1 and UNCERTAIN not in values
            column[column == OPEN] = NO_STATE if one else UNCERTAIN


def _calls_others(blocks: Blocks, place: int, calls: Sequence[Call]) -> bool:
    """Returns whether a program calls, or may call, a program that the job does not have."""
    known = {call.block for call in calls if call.caller == place}
    known.update(blocks.findings.jumps, blocks.findings.rounds)
    return any(block not in known for block, _ in blocks.findings.breaks)


def _states_first(column: IntArray) -> bool:
    """Returns whether a state is set before it may be another."""
    stated = np.flatnonzero(column != NO_STATE)
    return bool(len(stated)) and column[stated[0]] != OPEN


def _list_values(blocks: Blocks, group: Modal) -> set[int | str]:
    """Returns the values that a program gives a state, those with a name by it."""
    found, column = blocks.findings, blocks.state[:, group]
    out: set[int | str] = set()
    for value in np.unique(column[(column != NO_STATE) & (column != OPEN)]).tolist():
        if group == Modal.TOOL and value > 0:
            out.add(found.names[value - 1])
        else:
            out.add(found.names[NAMED - value] if value <= NAMED else value)
    if group == Modal.SHIFTED and any(any(zero) for *_, zero in found.local):
        out.add(1)  # stays in force when another work offset is called
    if group == Modal.FRAME and found.frames:
        out.add(UNCERTAIN)  # one name, and two frames
    return out


def carry_states(files: Files, found: Sequence[Blocks], calls: Sequence[Call]) -> None:
    """Enters in the first block of called programs what is in force where they are called.

    A state that differs between calls is uncertain there, and a sentence is added.
    """
    first = [blocks.state[0].copy() for blocks in found]
    entered: dict[tuple[int, Modal], dict[int, Call]] = {}
    programs = {call.caller for call in calls} | {call.called for call in calls if call.repeats}
    for _ in files:  # a called program may call others
        before, entered = entered, {}
        force = {k: in_force(found[k]) for k in programs}
        for call in calls:
            for group in set(found[call.called].findings.groups) - {Modal.SHIFTED}:
                if first[call.called][group] == NO_STATE:
                    value = 0  # where it begins for the first time
                    if call.caller != call.called:
                        value = _state_at(found, first, force, calls, call, group)
                    values = entered.setdefault((call.called, group), {})
                    values.setdefault(
                        _rename(value, group, found[call.caller], found[call.called]), call
                    )
                    for end in _list_ends(found, force, call, group):
                        values.setdefault(end, call)
        for (k, group), values in entered.items():
            found[k].state[0, group] = next(iter(values)) if len(values) == 1 else UNCERTAIN
            changes = found[k].findings.changes
            if group == Modal.TOOL and changes and changes[0]:
                changes.insert(0, 0)  # the tool of the caller is in the spindle
        if entered == before:
            break
    apart = {k: tuple(values.values()) for (k, _), values in entered.items() if len(values) > 1}
    for k, some in apart.items():
        lines = (f"{files[c.caller][0]}:{found[c.caller].line(c.block)}" for c in some[:2])
        sentence = f"called in different modal states by {' and '.join(dict.fromkeys(lines))}"
        found[k].findings.told.append((0, f"{sentence}; state them here"))


def _state_at(
    found: Sequence[Blocks],
    first: Sequence[IntArray],
    force: Mapping[int, IntArray],
    calls: Sequence[Call],
    call: Call,
    group: Modal,
) -> int:
    """Returns a state of the caller at a call.

    Calls and jumps before it leave it uncertain. It is then the last one above, of the programs
    called since too if they state it; programs not in the job change none. Where the caller
    jumps, all that it states and calls must be one value.
    """
    blocks, k = found[call.caller], call.caller
    for block in (call.block, max(call.block - 1, 0)):  # the call makes its own uncertain
        if force[k][block, group] != UNCERTAIN:
            return int(force[k][block, group])
    jumps = bool(blocks.findings.jumps)
    upto = len(blocks.first) if jumps else call.block
    stated = _list_certain(blocks, group, slice(0, upto), jumps)
    since = stated[0][0] if stated else call.block * jumps
    values = {value for _, value in stated}
    if not stated or (jumps and blocks.findings.breaks[0][0] < since):
        values.add(0)
    for each in calls:
        if each.caller == k and (jumps or since <= each.block < call.block):
            theirs = found[each.called]
            own = int(first[each.called][group] == NO_STATE)  # else what it begins with
            ends = _list_certain(theirs, group, slice(own, None), bool(theirs.findings.jumps))
            values |= {_rename(value, group, theirs, blocks) for _, value in ends}
    return values.pop() if len(values) == 1 else UNCERTAIN


def _list_ends(
    found: Sequence[Blocks], force: Mapping[int, IntArray], call: Call, group: Modal
) -> list[int]:
    """Returns what a program that a call runs again may leave a state at that it begins with."""
    if not call.repeats:
        return []
    theirs, last = found[call.called], int(force[call.called][-1, group])
    stated = _list_certain(theirs, group, slice(1, None), bool(theirs.findings.jumps))
    return [value for _, value in stated] + [last] * (last == UNCERTAIN)


def _list_certain(blocks: Blocks, group: Modal, part: slice, every: bool) -> list[tuple[int, int]]:
    """Returns blocks of a part that set a state, and its values there; the last one, or all."""
    column = stated_column(blocks, group)[part]
    found = np.flatnonzero((column != NO_STATE) & (column != UNCERTAIN))
    found = found if every else found[-1:]
    return list(zip(found.tolist(), column[found].tolist(), strict=True))


def _rename(value: int, group: Modal, ours: Blocks, theirs: Blocks) -> int:
    """Returns a state with the number that its name has in another program."""
    if group == Modal.TOOL and value > 0:
        return theirs.findings.name(ours.findings.names[value - 1]) + 1
    if group == Modal.FRAME and value <= NAMED:
        return NAMED - theirs.findings.name(ours.findings.names[NAMED - value])
    return value


def _pattern(name: str, data: bytes) -> re.Pattern[bytes]:
    """Returns what a call of a program contains: its name, that in it, or its O number."""
    stem = re.split(r"[\\/]", name)[-1].partition(".")[0]
    names = {re.escape(stem.encode())} if stem else set()
    head = data[:4096]
    names |= {re.escape(match[1] or match[2]) for match in _NAMED.finditer(head)}
    words = [rb"\b" + each + rb"\b" for each in names]
    for match in PROGRAM_NUMBER.finditer(head):
        words += [rb"\b[PO]0*%b\b" % match[1], rb"\bP\d{1,4}%b\b" % match[1].zfill(4)]
    return re.compile(b"|".join(words) or rb"(?!)", re.IGNORECASE)
