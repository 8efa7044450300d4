"""Simulated results are marked in every command; measured ones are not, whatever their names."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest
import typer
from mark_cases import CASES, WITHOUT_RESULT, Lab, fill
from typer.testing import CliRunner

from robotrue.app import demo_virtual
from robotrue.cli.main import app
from robotrue.core.provenance import MARK, MEASURED, Provenance
from robotrue.measurement.formats.measured_files import read_measurements
from robotrue.report.content import ReportTable, TableColumn
from robotrue.report.demo_result import DemoResult
from robotrue.simulation.flange_hole import FlangeHole
from robotrue.simulation.presets import deng2022, reflector_at_tool

SIMULATED = Provenance(simulated=True, instrument="virtual tracker")


@dataclass(frozen=True)
class Printed:
    """What one command printed as text and as JSON, and the files it wrote."""

    out: str
    err: str
    document: dict[str, object]
    pages: tuple[str, ...]
    twins: tuple[dict[str, object], ...]
    files: tuple[str, ...]


def call(*words: object) -> tuple[str, str]:
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout, done.stderr


def renewed(lab: Lab, command: str) -> None:
    """Makes room for what a command would not write twice, and the items it needs."""
    space = lab.folder / "space"
    if command == "sense run":
        for path in (*lab.folder.glob("*record/*"), *lab.folder.glob("*live.csv")):
            path.unlink()
    elif command == "workspace add" and not space.exists():
        call("workspace", "init", space)
        call("workspace", "add", "cell", lab("cell.toml"), "--name", "cell", "-w", space)
    elif command == "workspace add":  # one set of the name remains
        call("workspace", "delete", "set", "-w", space)
    elif command == "workspace list":
        out, _ = call("workspace", "list", "measurement", "-w", space, "--json")
        (lab.folder / "set").write_text(json.loads(out)["items"][0]["id"])
    elif command == "workspace delete":
        if (lab.folder / "deleted").exists():
            call("workspace", "undo", (lab.folder / "set").read_text(), "-w", space)
        (lab.folder / "deleted").touch()
    elif command == "jobs list" and not (lab.folder / "job").exists():
        call("workspace", "add", "model", lab("m.rtm"), "--name", "model", "-w", space)
        out, _ = call("jobs", "submit", "drift_plan", "-p", "model=model", "-w", space, "--json")
        (lab.folder / "job").write_text(json.loads(out)["id"])
        call("jobs", "run", "--until-idle", "-w", space)


def marks(document: dict[str, object]) -> bool:
    """Whether a result, or the one item of a list, says that it is simulated."""
    items = document.get("items", document.get("jobs", ()))
    return document.get("simulated") is True or any(
        each.get("simulated") is True for each in items if isinstance(each, dict)
    )


def mark_title(text: str) -> bool:
    """Whether an exported file carries the mark in the way its format has for it."""
    return MARK in text or "simulated = true" in text or '"simulated": true' in text


def all_printed(lab: Lab, *, text: bool) -> dict[str, Printed]:
    """Runs every case for JSON and its pages; ``text``: for text as well, and for ``--report``."""
    fill(lab)
    out = {}
    for command, case in CASES.items():
        renewed(lab, command)
        words = (*command.split(), *case.words(lab))
        said = call(*words) if text else ("", "")
        if text:
            renewed(lab, command)
        pages = [lab(name) for name in case.pages if text or not case.report]
        report = ("--report", lab(case.report)) if case.report and text else ()
        shown, err = call(*words, *report, "--json")
        twins = [page.with_suffix(".json") for page in pages]
        out[command] = Printed(
            out=said[0],
            err=said[1] if text else err,
            document=json.loads(shown),
            pages=tuple(page.read_text(encoding="utf-8") for page in pages),
            twins=tuple(json.loads(p.read_text()) for p in twins if p.is_file()),
            files=tuple(lab(name).read_text(encoding="utf-8") for name in case.files),
        )
    return out


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Printed]:
    """Marked data in files whose names say nothing."""
    folder = tmp_path_factory.mktemp("lab") / "cell 7"
    return all_printed(Lab(folder=folder, prefix="", origin=SIMULATED), text=True)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Printed]:
    """The same data without marks, in files and folders that are called simulated."""
    folder = tmp_path_factory.mktemp("lab") / "simulated"
    return all_printed(Lab(folder=folder, prefix="simulated_", origin=MEASURED), text=False)


def names(command: object, before: tuple[str, ...] = ()) -> set[str]:
    """Names of all commands of the application."""
    inner = getattr(command, "commands", None)
    if inner is None:
        return {" ".join(before)}
    return set().union(*(names(each, (*before, name)) for name, each in inner.items()))


def test_every_command_has_a_case_or_a_reason() -> None:
    every = names(typer.main.get_command(app))
    assert every == CASES.keys() | WITHOUT_RESULT.keys()
    assert not CASES.keys() & WITHOUT_RESULT.keys()


@pytest.mark.parametrize("command", CASES)
def test_a_simulated_result_is_marked(simulated: dict[str, Printed], command: str) -> None:
    printed = simulated[command]
    if printed.out.strip():
        assert MARK in printed.out
    else:
        assert MARK in printed.err
    assert marks(printed.document), printed.document
    for page in printed.pages:
        assert "SIMULATED DATA" in page
    for twin in printed.twins:
        assert twin["simulated"] is True
    for text in printed.files:
        assert mark_title(text)


@pytest.mark.parametrize("command", CASES)
def test_a_measured_result_is_not_marked(measured: dict[str, Printed], command: str) -> None:
    printed = measured[command]
    assert not marks(printed.document), printed.document
    for text in (printed.err, *printed.pages, *printed.files):
        assert MARK not in text.replace("SIMULATED_", "")
        assert not mark_title(text)
    for twin in printed.twins:
        assert twin["simulated"] is False


def test_compensated_programs_do_not_differ(
    tmp_path_factory: pytest.TempPathFactory,
    simulated: dict[str, Printed],
    measured: dict[str, Printed],
) -> None:
    base = tmp_path_factory.getbasetemp()
    (plain,) = base.glob("lab[0-9]*/cell 7/after.src")
    (other,) = base.glob("lab[0-9]*/simulated/simulated_after.src")
    assert plain.read_bytes() == other.read_bytes()


@pytest.mark.data
def test_a_measured_robot_is_not_marked_whatever_its_file_is_called(
    data_dir: Path, tmp_path: Path
) -> None:
    source = data_dir / "ur5-jacobi/3D_UR5_uncalibrated_grid_cleaned.csv"
    folder = tmp_path / "simulated"
    folder.mkdir()
    rows, cell, page = (folder / f"simulated_{n}" for n in ("ur5.csv", "cell.toml", "r.html"))
    rows.write_bytes(source.read_bytes())
    cell.write_text('schema = 1\n[robot]\npreset = "UR5"\n')
    words = ("calibrate", cell, rows, "-o", folder / "m.rtm", "--method", "geometric")
    out, err = call(*words, "--report", page)
    assert MARK not in out + err
    assert "SIMULATED DATA" not in page.read_text()
    out, _ = call("validate", folder / "m.rtm", rows, "--json")
    document = json.loads(out)
    assert document["simulated"] is False
    assert document["provenance"]["files"][0]["name"] == "simulated_ur5.csv"


def test_renaming_a_simulated_file_keeps_its_mark(tmp_path: Path) -> None:
    lab = Lab(folder=tmp_path / "lab", prefix="", origin=SIMULATED)
    fill(lab)
    renamed = lab("cal.csv").rename(lab("robot 12, measured.csv"))
    out, err = call("inspect", renamed)
    assert MARK in out
    assert MARK in err


def test_demo_and_its_data_are_marked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    table = ReportTable(title="dry run", columns=(TableColumn(title="mm"),), rows=((0.1,),))
    for virtual in (True, False):
        done = DemoResult(
            folder=tmp_path, page=tmp_path / "p.html", results={}, tables=(table,),
            simulated=virtual,
        )  # fmt: skip
        monkeypatch.setattr(demo_virtual, "run_virtual_demo", lambda *_, done=done, **__: done)
        out = "".join(call("demo", "--out", tmp_path, *more)[0] for more in (["--json"], []))
        assert (MARK in out) is virtual
        assert ('"simulated": true' in out) is virtual
    known, hole = reflector_at_tool(deng2022(1)), FlangeHole()
    demo_virtual.write_virtual_cell(known, hole, tmp_path)
    assert read_measurements(tmp_path / "calibration.csv").provenance.simulated
