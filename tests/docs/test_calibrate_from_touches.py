"""The page's code on the measured iiwa, and its table beside what comes out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "calibrate-from-touches.md"


@pytest.mark.data
def test_the_page_runs_and_its_numbers_come_out(data_dir, tmp_path, monkeypatch):
    text = PAGE.read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.S | re.M)
    assert len(blocks) == 3
    (tmp_path / "sockets").symlink_to(data_dir / "sockets-mukca" / "kuka_14")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile("\n".join(blocks), str(PAGE), "exec"), names)  # noqa: S102  our own page
    row = next(line for line in text.splitlines() if line.startswith("| iiwa 14 |"))
    printed = [float(cell.strip(" *")) for cell in row.split("|")[3:9]]
    held = names["held"]
    mean = np.concatenate([s.distance for s in held.values()]).mean() * 1e3
    # The page chooses with all places; the benchmark inside each training set.
    assert mean == pytest.approx(printed[4], abs=0.004)
    assert names["means"]["elastic"] * 1e3 == pytest.approx(printed[2], abs=0.001)
    assert names["estimate"].rms < 0.3e-3
