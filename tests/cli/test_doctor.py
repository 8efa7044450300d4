"""robotrue doctor: what it finds on this computer, and what it says of one that lacks something."""

from __future__ import annotations

import socket
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from robotrue.app.files_context import FilesContext
from robotrue.app.operations import doctor
from robotrue.app.presentation import Table
from robotrue.app.reporting import Silent
from robotrue.version import __version__


def values() -> dict:
    return dict(doctor.run(doctor.DoctorRequest(), FilesContext(Silent())).document())


def test_an_installation_that_runs_the_tests_is_ready(cli) -> None:
    got = cli("doctor", "--json")
    assert got.code == 0, got.err
    found = got.document
    assert found["version"] == __version__
    assert found["faults"] == []
    assert found["extras"].keys() == doctor.EXTRAS.keys()
    assert found["extras"]["web"] is found["extras"]["store"] is True
    assert found["libraries"]["numpy"] == metadata.version("numpy")
    shown = cli("doctor")
    assert "ready" in shown.err
    assert "pip install 'robotrue[NAME]'" in shown.out


def test_every_extra_of_users_is_named_and_in_all() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    of_developers = {"test", "lint", "docs", "mutants", "fuzz"}
    assert extras.keys() - of_developers - {"all"} == doctor.EXTRAS.keys()
    (named,) = extras["all"]
    # Not the PostgreSQL driver: workspaces are files unless a server is set up for them.
    whole = named.partition("[")[2].partition("]")[0].split(",")
    assert set(whole) == doctor.EXTRAS.keys() - {"store", "postgres"}
    assert "robotrue[store]" in extras["web"]


def test_libraries_that_are_missing_or_too_old_are_named(monkeypatch) -> None:
    real = metadata.version

    def version(name: str) -> str:
        if name == "typst":
            raise metadata.PackageNotFoundError(name)
        return "0.1" if name == "scipy" else real(name)

    monkeypatch.setattr(metadata, "version", version)
    shown = doctor.run(doctor.DoctorRequest(), FilesContext(Silent()))
    found = dict(shown.document())
    (extras,) = (each for each in shown.blocks() if isinstance(each, Table))
    assert [row[2] for row in extras.rows if row[0] == "pdf"] == ["typst missing"]
    assert found["extras"]["pdf"] is False
    assert found["lacking"] == {"pdf": ["typst"]}
    (fault,) = found["faults"]
    assert fault.startswith("scipy 0.1 (>=1.13 needed). Try: pip install")


def test_a_port_that_is_taken_is_named(monkeypatch) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        monkeypatch.setattr(doctor, "PORT", other.getsockname()[1])
        assert "is taken" in values()["port_fault"]


@pytest.mark.parametrize("installed", [("Noto Sans CJK SC",), ("DejaVu Sans",)])
def test_a_font_with_chinese_characters_is_named(monkeypatch, installed: tuple[str, ...]) -> None:
    typst = pytest.importorskip("typst")
    monkeypatch.setattr(typst, "Fonts", lambda: type("F", (), {"families": lambda _: installed})())
    assert values()["chinese_font"] == (installed[0] if "CJK" in installed[0] else "")
