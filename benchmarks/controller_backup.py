"""Controller backups of four makers, and a folder of all four: found, compensated, timed.

    python benchmarks/controller_backup.py [FILES]

Each backup has FILES files (500), programs in folders as its controller saves them. ``robotrue
compensate`` corrects it for a **simulated** arm; its CPU time is that of the whole command.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, TypeAlias

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "cli"))
import program_corpus as corpus
import shop

from robotrue.program.formats import read_job

START: Final = "0,-80,80,0,40,0"
"""deg, where the arm is before a program: some print no configuration."""
FAR, NEAR = "X 1000.0,Y 0.0,Z 500.0", "X 0.0,Y 0.0,Z 300.0"
"""A work frame of the corpus, and one that the arm reaches."""
NamedTexts: TypeAlias = Iterator[tuple[str, str, int]]
"""Name, text and number of moves of each file of a backup."""


def write_backup(folder: Path, files: int, maker: str = "KUKA") -> int:
    """Writes a controller backup of so many files; returns how many moves it has.

    Raises:
        KeyError: Another maker than those of ``BACKUPS``.
    """
    moves = 0
    folder.mkdir(parents=True, exist_ok=True)
    for name, text, count in BACKUPS[maker](files):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(text.encode("latin-1"))
        moves += count
    return moves


def _kuka_files(files: int) -> NamedTexts:
    yield "KRC/R1/System/$config.dat", corpus.CONFIG.replace(FAR, NEAR), 0
    yield "KRC/R1/Program/lib.src", f"DEF lib()\nEND\n{corpus.SETTINGS}", 0
    lines = "".join(f"LIN XP{k}:ABOVE\nLIN XP{k} C_DIS\n" for k in range(1, 21))
    above = "DECL FRAME ABOVE={X 0.0,Y 0.0,Z -120.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n"
    for number in range((files - 2) // 2):
        home = f"KRC/R1/Program/part{number % 20}/job{number}"
        yield (
            f"{home}.src",
            f"DEF job{number}()\nMoveSettings(1,1,100,50)\nIF $IN[1] THEN\nWAIT SEC 0\n"
            f"ENDIF\n{lines}rest()\nEND\nDEF rest()\nPTP XSERVICE\nEND\n",
            41,
        )
        yield f"{home}.dat", f"DEFDAT job{number}\n{corpus.print_points(20)}{above}", 0


def _abb_files(files: int) -> NamedTexts:
    yield "HOME/data.mod", f"MODULE data\n{corpus.DATA}ENDMODULE\n", 0
    for number in range(files - 1):
        names = [f"p{number}_{k}" for k in range(20)]
        points = "".join(
            f"LOCAL CONST robtarget {name}:={corpus.spot(5 * k, 8 * (number % 30), 1)};\n"
            for k, name in enumerate(names)
        )
        text = f"MODULE m{number}\n{points}PROC job{number}()\n{corpus.go(*names)}"
        yield f"RAPID/TASK1/PROGMOD/m{number}.mod", f"{text}ENDPROC\nENDMODULE\n", 20


def _fanuc_files(files: int) -> NamedTexts:
    yield "SYSFRAME.VA", corpus.FRAME_VA, 0
    head = "   1:  UFRAME_NUM=1 ;\n   2:  UTOOL_NUM=1 ;\n"
    lines = "".join(f"{k + 2:4d}:L P[{k}] 200mm/sec FINE    ;\n" for k in range(1, 21))
    points = dict.fromkeys(range(1, 21), (1, 1))
    for number in range(files - 1):
        text = corpus.ls(head + lines, points).replace("/PROG  JOB", f"/PROG  JOB{number}")
        yield f"MD/JOB{number}.LS", text, 20


def _yaskawa_files(files: int) -> NamedTexts:
    yield "UFRAME.CND", "//UFRAME 1\n///NAME\n///TOOL 0\n////BUSER 900,0,300,0,0,15\n", 0
    yield "TOOL.CND", "//TOOL 3\n///NAME torch\n0.0,5.0,380.0,0.0,35.0,0.0\n", 0
    head = "///USER 1\n///TOOL 3\n///POSTYPE USER\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\n"
    moves = "".join(f"MOVL C{k:05d} V=50.0\n" for k in range(20))
    points = "".join(f"C{k:05d}={10 * k}.0,{5 * k}.0,100.0,180.0,0.0,0.0\n" for k in range(20))
    for number in range(files - 2):
        text = corpus.print_job(head + points, moves).replace("NAME JOB", f"NAME JOB{number}")
        yield f"JOB{number}.JBI", text, 20


BACKUPS: Final[Mapping[str, Callable[[int], NamedTexts]]] = {
    "KUKA": _kuka_files, "ABB": _abb_files, "Fanuc": _fanuc_files, "Yaskawa": _yaskawa_files,
}  # fmt: skip


def compensate_backup(folder: Path) -> tuple[dict[str, Any], float]:
    """Returns what ``robotrue compensate`` says of a backup, and its CPU seconds (simulated arm).

    Raises:
        CalledProcessError: It was refused.
    """
    place = folder.with_name(f"{folder.name}-shop")
    place.mkdir()
    (place / "cell.toml").write_text(shop.CELL)
    joints = shop.postures(60, 1)
    shop.write_csv(place / "rows.csv", joints, shop.points(joints, noise_seed=2))
    run = [sys.executable, "-c", "from robotrue.cli.main import run; run()"]
    fit = [*run, "calibrate", "cell.toml", "rows.csv", "-o", "model.rtm", "--method", "elastic"]
    subprocess.run(fit, cwd=place, check=True, capture_output=True)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [
        *run,
        "compensate",
        "model.rtm",
        str(folder),
        "-o",
        "out",
        "--allow-steps",
        "--start",
        START,
    ]
    told = subprocess.run([*command, "--json"], cwd=place, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = after.ru_utime + after.ru_stime - spent.ru_utime - spent.ru_stime
    return json.loads(told.stdout), took


def time_backups(files: int) -> None:
    """Prints what is found in a backup of each maker, and in a folder of all of them."""
    places = {maker: [(maker, files)] for maker in BACKUPS}
    places["all four"] = [(maker, files // len(BACKUPS)) for maker in BACKUPS]
    for what, parts in places.items():
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "backup"
            wanted = sum(
                write_backup(folder / maker if len(parts) > 1 else folder, count, maker)
                for maker, count in parts
            )
            begun = time.process_time()
            programs = tuple(read_job(folder))
            read = time.process_time() - begun
            document, took = compensate_backup(folder)
        rows, moves = len(document["programs"]), corpus.count_moves(programs)
        print(
            f"{what:9} backup of {files} files: {moves} of {wanted} moves read in "
            f"{read:.1f} CPU s; compensated: {rows} rows, {document['compensated']} of "
            f"{document['targets']} targets, {took:.1f} CPU s",
            flush=True,
        )


if __name__ == "__main__":
    time_backups(int(sys.argv[1]) if len(sys.argv) > 1 else 500)
