"""RAPID's instructions: which of them move, the places of their arguments, which change nothing."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from robotrue.program.formats.rapid_scan import SKIP, arguments, clean
from robotrue.program.program import Motion


class Move(NamedTuple):
    """A motion instruction.

    Attributes:
        motion: How it moves to its (last) target.
        targets: How many targets come first.
        tool: Which argument is the tool, from 0, options not counted.
        axes: The target is a jointtarget.
    """

    motion: Motion
    targets: int
    tool: int
    axes: bool = False


class Tail(NamedTuple):
    """The arguments of a motion.

    Attributes:
        tool: Name in lower case, or the text that is no name.
        work: Work object, likewise; empty if none is named.
        places: Byte stretches of the targets in it.
    """

    tool: str
    work: str
    places: tuple[tuple[int, int], ...]


_PLAIN: Final = {
    "movel": Move(Motion.LIN, 1, 3),
    "movej": Move(Motion.PTP, 1, 3),
    "movec": Move(Motion.ARC_END, 2, 4),
    "moveabsj": Move(Motion.PTP, 1, 3, True),
    "triggl": Move(Motion.LIN, 1, 4),
    "triggj": Move(Motion.PTP, 1, 4),
    "triggc": Move(Motion.ARC_END, 2, 5),
    "trigglios": Move(Motion.LIN, 1, 3),
}
_FORMS: Final = {
    f"move{kind}{form}": _PLAIN[f"move{kind}"]
    for kind in "ljc"
    for form in ("do", "ao", "go", "sync")
}
_WELDING: Final = {
    f"arc{kind}{system}{part}": move
    for kind, move in (("l", Move(Motion.LIN, 1, 5)), ("c", Move(Motion.ARC_END, 2, 6)))
    for system in ("", "1", "2")
    for part in ("", "start", "end")
}
_MOVES: Final = _PLAIN | _FORMS | _WELDING

BUILT_IN: Final = frozenset(
    """accset activeventbuffer actunit add aliasio aliasioreset bitclear bitset break
    cirpathmode clear clearpath clkreset clkstart clkstop close confj confl confjoff corrclear
    corrcon corrdiscon corrwrite deactunit decr dropwobj eoffsoff eoffson eoffsset errlog errraise
    errwrite gripload idelete idisable ienable incr invertdo iodisable ioenable isignaldi isignaldo
    isleep itimer iwatch load loadid mechunitload motsup pathaccellim pathreclimit pathrecstart
    pathrecstop pathresol pdispoff pdispon pdispset pulsedo raise refreshdata reset restopath retry
    rewind save searchc searchj searchl set setao setdo setgo singarea softact softdeact speedlim
    speedrefresh spystart spystop startload startmove stop stopmove storepath tperase tpreadfk
    tpreadnum tpshow tpwrite triggequip trigginnt triggint triggio triggrampao triggspeed
    triggstopproc trynext tunereset tuneservo uimsgbox uishow unload velset waitdi waitdo waitai
    waitao waitgi waitgo waitload waitrob waitsyncTask waittime waituntil waitwobj worldacclim write
    writebin writestrbin syncmoveon syncmoveoff syncmovesuspend syncmoveresume waitsynctask exit
    exitcycle connect wzboxdef wzcyldef wzdosset wzenable wzdisable wzfree wzlimsup open text
    singareaoff moveextj cirpathreori clearrawbytes copyrawbytes packrawbytes unpackrawbytes
    packdnheader readrawbytes writerawbytes readanybin writeanybin cleariobuff copyfile removefile
    renamefile makedir removedir opendir closedir rewind socketcreate socketconnect socketbind
    socketlisten socketaccept socketsend socketsendto socketreceive socketreceivefrom socketclose
    tpreaddnum uimsgwrite uimsgwriteabort ivarvalue ipers ierror ipathpos irmqmessage isignalai
    isignalao isignalgi isignalgo triggcheckio triggdataclear triggdatacopy triggdatareset
    deactEventBuffer stopmovereset stepbwdpath resetretrycount procerrrecovery geterrdata getdataval
    getsysdata readcfgdata readerrdata texttabinstall waitsensor writevar readvar pathreclimit
    testsigndefine testsignreset rmqsendmessage rmqfindslot rmqgetmessage rmqgetmsgdata
    rmqgetmsgheader rmqemptyqueue rmqreadwait rmqsendwait systemstopaction errtoerrlog warmstart
    setleadthrough motionprocessmodeset fricidinit getjointdata checkprogref eraseModule
    safetycontrollersyncrequest comment""".lower().split()
)
"""Instructions of the controller that change no tool, work object or program displacement."""
READING: Final = frozenset(
    """tpwrite waittime setdo setgo setao pulsedo accset velset confl confj singarea waitdi waitdo
    waituntil speedlim pdispset pdispon pdispoff eoffson eoffsset eoffsoff errwrite write tperase
    actunit deactunit gripload set reset if stop break exit return triggio triggequip triggspeed
    movel movej movec moveabsj""".split()
)
"""Instructions that change nothing they name."""
_TOKEN: Final = re.compile(r'"(?:[^"]|"")*"|[\w\x80-\xff]+|\S')
_OPERATORS: Final = frozenset("and or xor not div mod".split())
_SWALLOWED: Final = re.compile(
    rb"[\r\n][^\S\r\n]*+(?:(?:Move|Trigg|Arc)(?:L|J|C|AbsJ)\b|ENDPROC|PROC\b|ENDIF|SetDO\b)",
    re.IGNORECASE,
)


def move_of(word: str) -> Move | None:
    """Returns how an instruction moves, None if it does not."""
    return _MOVES.get(word)


def read_tail(data: bytes, start: int, end: int, move: Move, *, given: int) -> Tail | None:
    """Returns the arguments between two bytes of a motion instruction.

    None is returned where brackets do not match or another statement begins before the end.

    Args:
        data: The module.
        start: Byte after the instruction's name, or after a first target already read.
        end: Its end.
        move: What the instruction is.
        given: Targets already read.
    """
    gap = SKIP.match(data, start, end)
    first = gap.end() if gap else start
    if given and data[first : first + 1] not in (b",", b"\\"):
        return None
    found = arguments(data, start, end)
    if found is None or _SWALLOWED.search(data, start, end):
        return None
    places, rest = found.places[: move.targets - given], found.places[move.targets - given :]
    index = move.tool - move.targets
    tool = clean(data[slice(*rest[index])]) if index < len(rest) else ""
    # ``\WObj?w`` passes on an option that the caller may have left out.
    work = found.options.get("wobj", next((o for o in found.options if o[:4] == "wobj"), ""))
    return Tail(tool.lower(), work.lower(), tuple(places))


def behind_condition(text: str) -> str:
    """Returns the instruction of ``IF condition instruction``: the word right after an operand."""
    operand = False
    for token in _TOKEN.findall(text):
        word = token[0].isalnum() or token[0] == "_" or token[0] >= "\x80"
        if operand and word and token not in _OPERATORS:
            return str(token)
        operand = (word and token not in _OPERATORS) or token[-1] in ')]}"'
    return ""
