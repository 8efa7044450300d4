"""The command line in this process, and a calibrated shop."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import shop

from robotrue.cli.main import run


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        """Stdout as one JSON document; anything else on it fails here."""
        found = json.loads(self.out)
        assert isinstance(found, dict)
        return found

    @property
    def fault(self) -> dict[str, Any]:
        return dict(self.document["error"])


Command = Callable[..., Outcome]


@pytest.fixture
def cli(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Command:
    """Runs ``robotrue ARGS`` as the console script does."""

    def command(*args: object) -> Outcome:
        capfd.readouterr()
        monkeypatch.setattr(sys, "argv", ["robotrue", *map(str, args)])
        with pytest.raises(SystemExit) as stopped:
            run()
        out, err = capfd.readouterr()
        return Outcome(int(stopped.value.code or 0), out, err)

    return command


@pytest.fixture(scope="session")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with cell.toml, cal.csv, test.csv, part.src and a calibrated model.rtm."""
    from robotrue.app.files_context import FilesContext
    from robotrue.app.operations import calibrate
    from robotrue.app.reporting import Silent

    folder = tmp_path_factory.mktemp("shelf")
    (folder / "cell.toml").write_text(shop.CELL, encoding="utf-8")
    (folder / "part.src").write_bytes(shop.PROGRAM.encode("latin-1"))
    joints = shop.postures(60, seed=1)
    shop.write_csv(folder / "cal.csv", joints, shop.points(joints, noise_seed=2))
    joints = shop.postures(40, seed=3)
    shop.write_csv(folder / "test.csv", joints, shop.points(joints, noise_seed=4))
    request = calibrate.CalibrateRequest(
        cell=folder / "cell.toml",
        measurements=(folder / "cal.csv",),
        output=folder / "model.rtm",
        method="elastic",
    )
    calibrate.run(request, FilesContext(Silent()))
    for path in folder.iterdir():
        path.chmod(0o444)
    return folder


@pytest.fixture
def work(shelf: Path, tmp_path: Path) -> Path:
    """A fresh copy of the shelf."""
    for path in shelf.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path
