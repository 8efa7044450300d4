"""Dialects by name, by content and by suffix; jobs of one and two files."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from krl_samples import HEAD, job, replacement

from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import detect, read_job, read_program, write_program
from robotrue.program.lang import find_inserter, find_language, language_names, languages

P = "{X 1.000,Y 2.000,Z 3.000,A 4.000,B 5.000,C 6.000}"


def test_names() -> None:
    assert "krl" in language_names()
    assert find_language("krl").name == "krl"
    with pytest.raises(ConfigurationError, match="no dialect is called 'krx'"):
        find_language("krx")


def test_detect() -> None:
    assert detect(f"{HEAD}LIN {P}\n".encode(), "noname").name == "krl"
    assert detect(b"whatever", "x.SRC").name == "krl"
    with pytest.raises(FormatError, match=r"x\.txt:1: not a supported program; supported are "):
        detect(b"whatever", "x.txt")
    assert detect(b"def f():\n  movel(p[0,0,0,0,0,0])\n", "x.txt").name == "urscript"


def test_what_is_no_text_is_no_program_by_chance() -> None:
    binary = np.random.default_rng(1).integers(0, 256, (200, 12000), dtype=np.uint8)
    assert any(find_language("sinumerik").detect(each.tobytes()) > 0.4 for each in binary)
    for each in binary:
        with pytest.raises(FormatError, match=r"not a supported program"):
            detect(each.tobytes(), "poses.xlsx")
    assert detect(b"G1 X1\0", "x.mpf").name == "sinumerik"


def test_one_file(tmp_path: Path) -> None:
    path = tmp_path / "part.src"
    path.write_text(f"{HEAD}LIN {P}\nEND\n")
    program = read_program(path)
    out = write_program(program, replacement(program, by_mm=(0.5, 0, 0)))
    assert out == path.read_bytes().replace(b"X 1.000", b"X 1.500")


def test_two_files(tmp_path: Path) -> None:
    programs = job(tmp_path, f"{HEAD}LIN XP1\nEND\n", f"DEFDAT part\nDECL POS XP1={P}\nENDDAT\n")
    assert [p.name for p in programs] == ["part.src", "part.dat"]
    assert [p.name for p in read_job(tmp_path / "part.dat")] == ["part.dat"]
    with pytest.raises(FormatError, match=r"the targets are in 2 files: part\.src, part\.dat"):
        read_program(tmp_path / "part.src")


def test_a_companion_without_targets_is_left_out(tmp_path: Path) -> None:
    programs = job(tmp_path, f"{HEAD}LIN {P}\nEND\n", "DEFDAT part\nDECL INT n=5\nENDDAT\n")
    assert [p.name for p in programs] == ["part.src"]


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="cannot read"):
        read_job(tmp_path / "absent.src")


@pytest.mark.parametrize(
    ("name", "cure"),
    [("part.urp", r"\.script"), ("PART.TP", r"text \(\.LS\)"), ("part.pgf", r"modules \(\.mod\)")],
)
def test_other_forms_of_a_program_are_refused_with_what_to_give(name: str, cure: str) -> None:
    with pytest.raises(FormatError, match=rf"{name}:1: not a supported program.* Try: .*{cure}"):
        detect(b"\x1f\x8b\x08\x00", name)


TOY = """
import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.program.language import Language, read_each
from robotrue.program.program import Program


def read(data, name, frames):
    rows = [line.split()[1:] for line in data.decode().splitlines()]
    n = len(rows)
    zero = np.zeros(n, np.int64)
    return Program(
        name=name, dialect="toy", data=data, position=np.array(rows, float) * 1e-3,
        rotation=np.broadcast_to(np.eye(3), (n, 3, 3)), axes=np.full((n, 6), np.nan),
        motion=zero + 1, reason=zero, words=np.full((n, 0), NO_WORD),
        words_of="", line=zero + 1 + np.arange(n), frame=zero, tool=zero,
        T_base_frame=frames.T_base_frame[None], T_flange_tool=frames.T_flange_tool[None],
    )


def write(program, replacement):
    rows = [f"GO {x:.3f} {y:.3f} {z:.3f}" for x, y, z in replacement.position * 1e3]
    return "\\n".join([*rows, ""]).encode()


LANGUAGE = Language(
    name="toy", suffixes=(".toy",), score=lambda data: float(data.startswith(b"GO ")),
    reader=read_each(read), writer=write,
)
"""


@pytest.fixture
def toy_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    info = tmp_path / "toy-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[robotrue.languages]\ntoy = toy_words:LANGUAGE\n")
    monkeypatch.syspath_prepend(tmp_path)
    languages.cache_clear()
    yield tmp_path
    languages.cache_clear()
    sys.modules.pop("toy_words", None)


def test_a_package_outside_registers_a_language(toy_package: Path) -> None:
    (toy_package / "toy_words.py").write_text(TOY)
    path = toy_package / "part.toy"
    path.write_text("GO 1.000 2.000 3.000\nGO 4.000 5.000 6.000\n")
    assert "toy" in language_names()
    program = read_program(path)
    assert program.position.tolist() == [[1e-3, 2e-3, 3e-3], [4e-3, 5e-3, 6e-3]]
    out = write_program(program, replacement(program, by_mm=(0.5, 0, 0)))
    assert out == b"GO 1.500 2.000 3.000\nGO 4.500 5.000 6.000\n"
    with pytest.raises(ConfigurationError, match="moves of a toy program are not split"):
        find_inserter("toy")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("raise ValueError('broken')", r"'toy_words:LANGUAGE' .* cannot be imported: broken"),
        ("LANGUAGE = 5", "is int, expected a Language"),
        (TOY.replace('"toy"', '"krl"'), "is a second language 'krl'"),
        (TOY.replace('".toy"', '".TOY"'), r"language 'toy' with suffixes \.TOY"),
    ],
)
def test_a_package_outside_that_cannot_be_used_is_named(
    toy_package: Path, text: str, why: str
) -> None:
    (toy_package / "toy_words.py").write_text(text)
    with pytest.raises(ConfigurationError, match=why):
        languages()
