"""A cell of nothing but digits takes linear time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from robotrue.errors import FormatError
from robotrue.measurement.formats.sheet_file import read_sheet


@pytest.mark.parametrize("ends", ["x", "-"])
def test_a_long_number_takes_linear_time(tmp_path: Path, ends: str) -> None:
    def seconds(digits: int) -> float:
        path = tmp_path / "sheet.csv"
        path.write_text(f'"{"1" * digits}{ends}";j1_deg\n1;2\n')
        took = []
        for _ in range(3):
            begun = time.process_time()
            read_sheet(path)
            took.append(time.process_time() - begun)
        return min(took)

    assert seconds(32_000) < 0.1 + 8.0 * seconds(8_000)


def test_a_cell_beyond_the_reader_is_refused_by_line(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(f"j1_deg;j2_deg\n1;{'1' * 200_000}\n")
    with pytest.raises(FormatError, match="cannot be split into columns") as refused:
        read_sheet(path)
    assert refused.value.line == 2
