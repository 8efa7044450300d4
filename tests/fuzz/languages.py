"""The languages that are tried: who writes programs of each, and which pieces damage is made of."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "properties"))
sys.path.insert(0, str(Path(__file__).parents[1] / "program"))

import test_program_fanuc
import test_program_jbi
import test_program_krl_damage
import test_program_rapid
import test_program_urscript
from fanuc_programs import fanuc
from jbi_programs import jbi
from krl_programs import krl
from path_programs import PATHS, apt, fanuc_gcode, heidenhain, sinumerik, toolpath_csv
from path_samples import SAMPLES
from rapid_programs import rapid
from urscript_programs import urscript
from val3_programs import PIECES as VAL3
from val3_programs import val3
from written import TABLE, Pen, Writer

from robotrue.program.program import FrameTable


@dataclass(frozen=True)
class Language:
    """One dialect.

    Attributes:
        writer: Writes jobs.
        sample: One file with all that a hand wrote into it.
        name: Of that file.
        pieces: Of the language.
    """

    writer: Writer
    sample: bytes
    name: str
    pieces: Sequence[bytes]


G_CODE = [
    *(b"G1 ", b"G2 ", b"G3 ", b"G91 ", b"G90 ", b"X", b"Y1.", b"Z", b"A", b"I", b"J", b"K", b"R5"),
    *(
        b"\n",
        b"\r",
        b"(",
        b")",
        b";",
        b"=",
        b"#1",
        b"N",
        b"M30",
        b"%",
        b".",
        b"-",
        b"G54 ",
        b"\xff",
    ),
    *(
        b"TRAORI\n",
        b"G43.4",
        b"G43.5",
        b"CIP ",
        b"JT1=",
        b"A3=",
        b"CR=",
        b"TRANS ",
        b"G68",
        b"\x00",
    ),
]
HEIDENHAIN = [
    *(
        b"L ",
        b"LN ",
        b"CC ",
        b"C ",
        b"CR ",
        b"X+",
        b"Y-1",
        b"Z",
        b"IX",
        b"A+",
        b"DR+",
        b"R0",
        b"FMAX",
    ),
    *(
        b"M128",
        b"M129",
        b"BEGIN PGM ",
        b"END PGM",
        b"INCH",
        b"\n",
        b"Q1",
        b";",
        b"TX",
        b"NX",
        b"\xff",
    ),
    *(b"CYCL DEF 7.1 X+1\n", b"PLANE SPATIAL", b"0 ", b"99999999 ", b"\x00", b"~"),
]
APT = [
    *(
        b"GOTO/",
        b"GODLTA/",
        b"FROM/",
        b"CIRCLE/",
        b"MULTAX/OFF",
        b"UNITS/INCHES",
        b"$",
        b"$$",
        b",",
    ),
    *(
        b"\n",
        b"/",
        b"TRANS/1,2,3\n",
        b"PPRINT ",
        b"CYCLE/",
        b"FINI\n",
        b"1E9",
        b"\xff",
        b"\x00",
        b"0,0,0",
    ),
]
CSV = [
    *(
        b",",
        b";",
        b'"',
        b'""',
        b"\n",
        b"\r",
        b"#",
        b"x_mm",
        b"i",
        b"rapid",
        b"1",
        b" ",
        b"\t",
        b"\xff",
    ),
    *(b"\x00", b"-", b".", b"nan", b"0,0,0", b"\xef\xbb\xbf"),
]

LANGUAGES: dict[str, Language] = {
    "krl": Language(
        krl, test_program_krl_damage.SAMPLE, "part.src", test_program_krl_damage.PIECES
    ),
    "rapid": Language(rapid, test_program_rapid.SAMPLE, "part.mod", test_program_rapid.PIECES),
    "jbi": Language(jbi, test_program_jbi.SAMPLE, "part.jbi", test_program_jbi.PIECES),
    "fanuc_ls": Language(fanuc, test_program_fanuc.SAMPLE, "part.ls", test_program_fanuc.PIECES),
    "urscript": Language(
        urscript, test_program_urscript.SAMPLE, "part.script", test_program_urscript.PIECES
    ),
    "sinumerik": Language(sinumerik, SAMPLES["sinumerik"], "part.mpf", G_CODE),
    "fanuc_gcode": Language(fanuc_gcode, SAMPLES["fanuc_gcode"], "part.nc", G_CODE),
    "heidenhain": Language(heidenhain, SAMPLES["heidenhain"], "part.h", HEIDENHAIN),
    "apt": Language(apt, SAMPLES["apt"], "part.apt", APT),
    "val3": Language(val3, val3(Pen.of(3)).files[0][1], "job.pgx", VAL3),
    "toolpath_csv": Language(toolpath_csv, SAMPLES["toolpath_csv"], "part.csv", CSV),
}


def frames_of(name: str) -> FrameTable:
    """The frames programs of a language are read with."""
    return PATHS if name in SAMPLES else TABLE
