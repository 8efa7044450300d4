"""Steps of a slot test from a file, and what such a file may get wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import MM
from robotrue.errors import FormatError
from robotrue.measurement.formats.slot_steps import read_slot_steps


def written(folder: Path, text: str) -> Path:
    path = folder / "steps.csv"
    path.write_text(text)
    return path


def test_rows_of_one_slot_are_its_places(tmp_path: Path) -> None:
    text = "step_mm,Slot\n0.68,left\n0.70,left\n-0.71,right\n"
    names, step = read_slot_steps(written(tmp_path, text))
    assert names == ("left", "right")
    np.testing.assert_allclose(step / MM, [[0.68, 0.70], [-0.71, np.nan]])


def test_decimal_commas_are_read(tmp_path: Path) -> None:
    _, step = read_slot_steps(written(tmp_path, "slot;step_mm\n1;0,68\n2;0,71\n"))
    np.testing.assert_allclose(step / MM, [[0.68], [0.71]])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("slot\n1\n", r":1: no column step_mm"),
        ("slot,step\n1,0.68\n", r":1: unknown column 'step'; .*: rename it to 'step_mm'"),
        ("slot,step_mm,z_mm\n1,0.68,3\n", r":1: unknown column 'z_mm'"),
        ("slot,step_mm\n1,0.68\n2,-\n", r":3: step_mm is -"),
        ("slot,step_mm\n1,0.68\n,0.7\n", r":3: column 'slot' is blank"),
        ("slot,step_mm\n1,nan\n", r":2: step_mm is nan"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text, told) -> None:
    with pytest.raises(FormatError, match=told):
        read_slot_steps(written(tmp_path, text))
