"""Keywords and odd codes of G-code: what they set, move, end or leave as it is."""

from __future__ import annotations

from typing import Final

from robotrue.program.formats.gcode_vocabulary import UNCERTAIN, Drive, Modal

QUIET: Final = frozenset(
    b"ORIVECT ORIWKS ORIAXES ORIVIRT1 ORIVIRT2 ORIPLANE STOPRE FFWON FFWOF SOFT BRISK DRIVE "
    b"COMPCAD COMPCURV COMPON COMPSURF COMPOF UPATH SPATH SPCON SPCOF MSG FIFOCTRL STARTFIFO "
    b"STOPFIFO CFC CFTCP CFIN FNORM FLIN FCUB FGROUP CYCLE832 CYCLE_HSC ADIS ADISPOS WALIMON "
    b"WALIMOF DEF EXTERN PROC DISPLOF DISPLON SAVE SBLOF SBLON G290 WAITM SETM CLEARM ACC "
    b"FGREF DYNNORM DYNPOS DYNROUGH DYNSEMIFIN DYNFINISH RTLION RTLIOF OSC OSSE OSOF OSS OST "
    b"CUT2D CUT2DF CUT3DC CUT3DF NORM KONT WRTPR ORISON ORISOF OTOL CTOL RET BLSYNC "
    b"WORKPIECE GROUP_BEGIN GROUP_END GETD GET RELEASE AND OR LIMS DELAYFSTON "
    b"DELAYFSTOF PRIO".split()
)
"""Keywords that do not concern positions."""
SHIFTS: Final = {
    **dict.fromkeys(
        b"TRANS ATRANS ROT AROT ROTS AROTS CROTS RPL SCALE ASCALE MIRROR AMIRROR".split(), "program"
    ),
    b"CYCLE800": "swivel", b"TOROT": "tool frame", b"TOFRAME": "tool frame", b"PAROT": "part",
    b"TRANSMIT": "transformation", b"TRACYL": "transformation", b"TRAANG": "transformation",
    b"MEAFRAME": "measured", b"ORIRESET": "machine", b"DIAMON": "diameter", b"DIAM90": "diameter",
}  # fmt: skip
"""Keywords that move, turn or scale coordinates, each in its own way."""
CANCELS: Final = {
    **dict.fromkeys(b"TRANS ROT ROTS SCALE MIRROR".split(), "program"),
    b"CYCLE800": "swivel", b"TOROTOF": "tool frame", b"PAROTOF": "part", b"DIAMOF": "diameter",
}  # fmt: skip
"""Keywords that end one of these shifts when they are alone."""
DRIVES: Final = {
    b"CIP": Drive.THROUGH,
    **dict.fromkeys((b"CT", b"INVCW", b"INVCCW", b"POLY", b"ASPLINE", b"BSPLINE", b"CSPLINE"),
                    Drive.OTHER),
}  # fmt: skip
OWN_MOVES: Final = (b"CYCLE", b"POCKET", b"HOLES", b"SLOT", b"LONGHOLE")
CYCLES: Final = tuple(each.decode() for each in OWN_MOVES)
SETS: Final = {
    b"TRAORI": (Modal.TIP, 1), b"TRAFOOF": (Modal.TIP, 0), b"PTP": (Modal.AXIS_WISE, 1),
    b"PTPG0": (Modal.AXIS_WISE, UNCERTAIN), b"CP": (Modal.AXIS_WISE, 0),
    b"ORIRPY": (Modal.ANGLES, 1), b"ORIEULER": (Modal.ANGLES, 2), b"ORIRPY2": (Modal.ANGLES, 2),
    b"ORIMKS": (Modal.ANGLES, 2), b"CUT3D": (Modal.SIDEWAYS, 1),
}  # fmt: skip
MACHINE: Final = ("G53", "G153")
HOMES: Final = ("G28", "G30", "G74", "G75", "G27", "M6")
MOVING: Final = {
    **dict.fromkeys(("G10", "G50", "G92", "G92.1"), "zero"), "G52": "local", "G51": "scale",
    **dict.fromkeys(("G68", "G68.2", "G68.3", "G68.4", "G53.1"), "rotation"), "G16": "polar",
    **dict.fromkeys(("G54.2", "G54.4"), "table"), "G51.1": "mirror", "G58": "program",
    "G59": "program", "G254": "dynamic offset",
}  # fmt: skip
"""Codes that move, turn or scale coordinates."""
ENDING: Final = {
    "G69": "rotation",
    "G255": "dynamic offset",
    "G50": "scale",
    "G50.1": "mirror",
    "G15": "polar",
}
"""Codes that end one of these shifts when they have no coordinate."""
CALLS: Final = ("G65", "M98", "M198", "M99")
QUIET_CODES: Final = ("G4", "G5", "G5.1", "G7.1", "G11", "G13")
"""Codes whose further words are no coordinates."""
