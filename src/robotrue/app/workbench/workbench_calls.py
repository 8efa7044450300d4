"""Calls of the workbench to the numeric libraries, run in a process next to its server.

The server imports this file and none of what it calls: each function imports its own when it runs.
Answers for a script of a page are JSON text, everything else is a record of the store. Nothing is
computed that a command would not compute the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from robotrue.store.nouns import (
    CellRecord,
    DocumentRecord,
    MeasurementRecord,
    ProgramRecord,
    RegistrationRecord,
)
from robotrue.store.workspace import Workspace

P = ParamSpec("P")
T = TypeVar("T")


def list_presets() -> bytes:
    """Returns every robot a cell can be made with, and the fields of the form of a cell."""
    from robotrue.app.workbench.cell_editor import list_presets as answer

    return answer()


def describe_cell(form: Mapping[str, object]) -> bytes:
    """Returns the cell.toml of a form, or what is wrong with which field."""
    from robotrue.app.workbench.cell_editor import describe_cell as answer

    return answer(form)


def save_cell_text(
    folder: str, text: str, name: str, id: str, version: int, companions: Sequence[Path] = ()
) -> CellRecord:
    """Returns the record of a cell.toml's text: a new cell, or a new version of one."""
    from robotrue.app.workbench.cell_editor import save_cell_text as answer

    return _ask(answer, folder, text, name, id, version, companions)


def read_cell_text(folder: str, id: str, version: int) -> bytes:
    """Returns the text of a cell's file."""
    from robotrue.app.workbench.cell_editor import read_cell_text as answer

    return _ask(answer, folder, id, version)


def add_sample_project(folder: str) -> CellRecord:
    """Returns the cell of a practice project that was added, with simulated poses and a program."""
    from robotrue.app.workbench.sample_project import add_sample_project as answer

    return _ask(answer, folder)


def import_cell(folder: str, paths: Sequence[Path], name: str) -> CellRecord:
    """Returns the record of a cell.toml and the files it names."""
    from robotrue.app.workbench.file_imports import import_cell as answer

    return _ask(answer, folder, paths, name)


def import_program(folder: str, paths: Sequence[Path], name: str) -> ProgramRecord:
    """Returns the record of a program's files as they are."""
    from robotrue.store.programs import add

    return _ask(add, folder, list(paths), name=name or None)


def import_measurements(
    folder: str, paths: Sequence[Path], name: str, cell: str, mapping: Mapping[str, object] | None
) -> MeasurementRecord:
    """Returns the record of measured poses, read and checked for plausibility."""
    from robotrue.app.workbench.file_imports import import_measurements as answer

    return _ask(answer, folder, paths, name, cell, mapping)


def import_check_poses(
    folder: str, paths: Sequence[Path], name: str, model: str
) -> MeasurementRecord:
    """Returns the record of a few poses measured again, in the cell that a model belongs to."""
    from robotrue.app.workbench.file_imports import import_check_poses as answer

    return _ask(answer, folder, paths, name, model)


def import_drilling(folder: str, paths: Sequence[Path], name: str) -> DocumentRecord:
    """Returns the record of a campaign with its foot, of a model, or of a journal."""
    from robotrue.app.workbench.drilling_import import import_drilling as answer

    return _ask(answer, folder, paths, name)


def preview_file(
    folder: str, paths: Sequence[Path], cell: str, mapping: Mapping[str, object] | None
) -> bytes:
    """Returns the columns of a file, how they would be read, and what is wrong with that."""
    from robotrue.app.workbench.file_imports import preview_file as answer

    return _ask(answer, folder, paths, cell, mapping)


def show_model(folder: str, model: str, version: int) -> bytes:
    """Returns the parameters of a model, their uncertainty, and those the data do not determine."""
    from robotrue.app.workbench.model_views import show_model as answer

    return _ask(answer, folder, model, version)


def judge_measurement(
    folder: str, measured: str, version: int, model: str, model_version: int
) -> bytes:
    """Returns the accuracy of a model on a set, its worst poses and screened rows."""
    from robotrue.app.workbench.model_views import judge_measurement as answer

    return _ask(answer, folder, measured, version, model, model_version)


def list_rows(
    folder: str, measured: str, version: int, sort: str, offset: int, limit: int
) -> bytes:
    """Returns some rows of a set: line of the file, joints in deg, position in mm."""
    from robotrue.app.workbench.model_views import list_rows as answer

    return _ask(answer, folder, measured, version, sort, offset, limit)


def show_plan(folder: str, plan: str, version: int) -> bytes:
    """Returns a plan as it was made, its scene, and how the instrument sees each pose."""
    from robotrue.app.workbench.cell_scene import show_plan as answer

    return _ask(answer, folder, plan, version)


def judge_program(
    folder: str,
    program: str,
    version: int,
    model: str,
    model_version: int,
    tolerance_mm: float | None,
    strict: bool,
) -> bytes:
    """Returns path, predicted errors, worst targets and verdict of a program."""
    from robotrue.app.workbench.program_judgement import judge_program as answer

    return _ask(answer, folder, program, version, model, model_version, tolerance_mm, strict)


def draw_cell(folder: str, cell: str, version: int) -> bytes:
    """Returns the scene of a cell without a model: arm and frames."""
    from robotrue.app.workbench.cell_scene import draw_cell as answer

    return _ask(answer, folder, cell, version)


def draw_model(folder: str, model: str, version: int) -> bytes:
    """Returns the scene of a model: its cell, measured errors, and the predicted field."""
    from robotrue.app.workbench.cell_scene import draw_model as answer

    return _ask(answer, folder, model, version)


def draw_measurement(
    folder: str, measured: str, version: int, model: str, model_version: int
) -> bytes:
    """Returns the scene of a set's errors before and after, by a model that need not know it."""
    from robotrue.app.workbench.cell_scene import draw_measurement as answer

    return _ask(answer, folder, measured, version, model, model_version)


def begin_probing(folder: str, stated: Mapping[str, object]) -> DocumentRecord:
    """Returns the record of a new probing session."""
    from robotrue.app.workbench.probing_begin import begin_probing as answer

    return _ask(answer, folder, stated)


def show_probing(folder: str, id: str, version: int, feature: int) -> bytes:
    """Returns a probing session: next point, expected reading, present estimate."""
    from robotrue.app.workbench.probing_view import show_probing as answer

    return _ask(answer, folder, id, version, feature)


def enter_reading(folder: str, id: str, version: int, feature: int, text: str) -> DocumentRecord:
    """Returns the session with one more reading; held, if it is not as expected."""
    from robotrue.app.workbench.probing_entry import enter_reading as answer

    return _ask(answer, folder, id, version, feature, text)


def decide_reading(
    folder: str, id: str, version: int, decision: str, feature: int
) -> DocumentRecord:
    """Returns the session after keep, retake, skip or undo."""
    from robotrue.app.workbench.probing_entry import decide_reading as answer

    return _ask(answer, folder, id, version, decision, feature)


def import_readings(folder: str, id: str, version: int, path: Path) -> DocumentRecord:
    """Returns the session with the readings of a file; those not as expected are set aside."""
    from robotrue.app.workbench.probing_entry import import_readings as answer

    return _ask(answer, folder, id, version, path)


def finish_probing(folder: str, id: str, version: int, name: str) -> RegistrationRecord:
    """Returns the record of the registration that a session's readings give."""
    from robotrue.app.workbench.probing_entry import finish_probing as answer

    return _ask(answer, folder, id, version, name)


def write_readings(folder: str, id: str) -> bytes:
    """Returns the readings that count, as the file that ``robotrue register`` reads."""
    from robotrue.app.workbench.probing_entry import write_readings as answer

    return _ask(answer, folder, id)


def _ask(
    answer: Callable[Concatenate[Workspace, P], T], folder: str, *args: P.args, **kwargs: P.kwargs
) -> T:
    with Workspace.open(folder) as workspace:
        return answer(workspace, *args, **kwargs)
