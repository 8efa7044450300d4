from __future__ import annotations

import re
from pathlib import Path

import numpy as np

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "use-the-learners.md"


def test_the_page_runs_and_says_the_truth(capsys):
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.S | re.M)
    assert len(blocks) == 5
    names: dict[str, object] = {}
    exec(compile("\n".join(blocks), str(PAGE), "exec"), names)  # noqa: S102  our own page
    assert "as printed" in capsys.readouterr().out
    X_new, y_new = names["X_new"], names["y_new"]
    missed = {
        name: np.abs(names[name].predict(X_new) - y_new).mean()  # type: ignore[attr-defined]
        for name in ("transfer", "boosted", "printed")
    }
    assert missed["transfer"] < 0.05
    assert missed["transfer"] < missed["boosted"] < missed["printed"]
