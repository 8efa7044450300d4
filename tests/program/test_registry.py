"""Dialects by name, by content and by suffix; jobs of one and two files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from krl_samples import HEAD, job, replacement

from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.formats import (
    detect,
    dialect,
    dialects,
    read_job,
    read_program,
    register,
    write_program,
)

P = "{X 1.000,Y 2.000,Z 3.000,A 4.000,B 5.000,C 6.000}"


def test_names() -> None:
    assert "krl" in dialects()
    assert dialect("krl").name == "krl"
    with pytest.raises(ConfigurationError, match="no dialect is called 'krx'"):
        dialect("krx")
    with pytest.raises(ConfigurationError, match="already"):
        register("krl", "elsewhere")


def test_detect() -> None:
    assert detect(f"{HEAD}LIN {P}\n".encode(), "noname").name == "krl"
    assert detect(b"whatever", "x.SRC").name == "krl"
    with pytest.raises(FormatError, match=r"x\.txt:1: not a program robotrue reads; it knows "):
        detect(b"whatever", "x.txt")
    assert detect(b"def f():\n  movel(p[0,0,0,0,0,0])\n", "x.txt").name == "urscript"


def test_what_is_no_text_is_no_program_by_chance() -> None:
    binary = np.random.default_rng(1).integers(0, 256, (200, 12000), dtype=np.uint8)
    assert any(dialect("sinumerik").detect(each.tobytes()) > 0.4 for each in binary)
    for each in binary:
        with pytest.raises(FormatError, match=r"not a program robotrue reads"):
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
    with pytest.raises(FormatError, match=r"the targets stand in 2 files: part\.src, part\.dat"):
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
    with pytest.raises(FormatError, match=rf"{name}:1: not a program .* Try: .*{cure}"):
        detect(b"\x1f\x8b\x08\x00", name)
