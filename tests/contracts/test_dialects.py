"""What every dialect promises, checked on the sample programs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.arm_words import NO_WORD
from robotrue.errors import FormatError
from robotrue.program.formats import detect, read_job, write_program
from robotrue.program.lang import find_language, language_names
from robotrue.program.program import FrameTable, Motion, Program, Replacement

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "program"))
from path_samples import SAMPLES, TABLE

SUFFIXES = tuple(suffix for name in language_names() for suffix in find_language(name).suffixes)


@pytest.fixture(scope="module")
def samples(data_dir: Path) -> list[Path]:
    folder = data_dir.parent / "programs"
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)
    if not found:
        pytest.skip(f"no sample programs in {folder}")
    return found


def shifted(program: Program, by_m: float) -> Replacement:
    return Replacement(
        changed=program.reason == 0,
        position=program.position + by_m,
        rotation=program.rotation,
        axes=program.axes,
        words=np.full_like(program.words, NO_WORD),
    )


@pytest.mark.data
def test_zero_correction_is_byte_identical(samples: list[Path]) -> None:
    for path in samples:
        for program in read_job(path, FrameTable()):
            assert program.data == path.with_name(program.name).read_bytes()
            assert write_program(program, shifted(program, 0.0)) == program.data


@pytest.mark.data
def test_written_targets_are_read_again(samples: list[Path], tmp_path: Path) -> None:
    moved = 0
    for path in samples:
        job = read_job(path, FrameTable())
        for program in job:
            (tmp_path / program.name).write_bytes(write_program(program, shifted(program, 3e-4)))
        again = read_job(tmp_path / path.name, FrameTable())
        for old, new in zip(job, again, strict=True):
            use = old.reason == 0
            moved += int(use.sum())
            np.testing.assert_array_equal(old.reason, new.reason)
            np.testing.assert_allclose(new.position[use], old.position[use] + 3e-4, atol=0.51e-6)
        for program in job:
            (tmp_path / program.name).unlink()
    assert moved > 0


@pytest.mark.data
def test_a_cut_off_file_is_refused_by_line_or_kept(samples: list[Path]) -> None:
    for path in samples:
        data, language = path.read_bytes(), find_language(detect(path.read_bytes(), path.name).name)
        for size in range(0, len(data), 7):
            part = data[:size]
            try:
                program = language.read(part, name=path.name, frames=FrameTable())
            except FormatError as error:
                refused: FormatError | None = error
            else:
                refused = None
                assert write_program(program, shifted(program, 0.0)) == part
            assert refused is None or (refused.line or 0) >= 1


@pytest.mark.data
def test_content_alone_names_the_dialect(samples: list[Path]) -> None:
    for path in samples:
        assert path.suffix.lower() in detect(path.read_bytes(), "noname").suffixes


@pytest.mark.data
def test_other_languages_are_not_taken_for_one_of_these(data_dir: Path) -> None:
    folder = data_dir.parent / "programs"
    others = [p for p in folder.rglob("*") if p.is_file() and p.suffix.lower() not in SUFFIXES]
    assert others
    for path in others:
        assert max(find_language(name).detect(path.read_bytes()) for name in language_names()) < 0.4


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_paths_of_words_are_told_from_all_others_and_kept(name: str, tmp_path: Path) -> None:
    data = SAMPLES[name]
    scores = {each: find_language(each).detect(data) for each in language_names()}
    assert all(0.0 <= score <= 1.0 for score in scores.values())
    assert scores.pop(name) > max(scores.values())
    (tmp_path / "part").write_bytes(data)
    (program,) = read_job(tmp_path / "part", TABLE)
    assert program.dialect == detect(data, "noname").name == name
    assert write_program(program, shifted(program, 0.0)) == data
    (tmp_path / "part").write_bytes(write_program(program, shifted(program, 3e-4)))
    (again,) = read_job(tmp_path / "part", TABLE)
    use = (program.reason == 0) & (program.motion != Motion.ARC_VIA)
    assert use.any()
    np.testing.assert_allclose(again.position[use], program.position[use] + 3e-4, atol=0.51e-6)
