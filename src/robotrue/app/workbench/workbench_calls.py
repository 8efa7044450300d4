"""Functions of the workbench, for the processes next to its server that call them.

The server imports this file and none of the others: the process that calls a function imports its
file. Answers for a script of a page are JSON text, everything else is a record of the store.
Nothing is computed that a command would not compute the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Concatenate, Generic, ParamSpec, TypeVar

from robotrue.store.workspace import Workspace

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class LateFunction:
    """A function whose file is imported when it is called."""

    file: str
    name: str

    def __call__(self, *args: object, **kwargs: object) -> Any:
        """Returns what the function returns."""
        module = import_module(f"robotrue.app.workbench.{self.file}")
        return getattr(module, self.name)(*args, **kwargs)


@dataclass(frozen=True, slots=True)
class LateFile:
    """A file of this folder, in place of the import of it."""

    file: str

    def __getattr__(self, name: str) -> LateFunction:
        return LateFunction(self.file, name)


@dataclass(frozen=True, slots=True)
class InWorkspace(Generic[P, T]):
    """A function of an open workspace, called with the folder of the workspace."""

    function: Callable[Concatenate[Workspace, P], T]

    def __call__(self, folder: str, *args: P.args, **kwargs: P.kwargs) -> T:
        """Returns what the function returns."""
        with Workspace.open(folder) as workspace:
            return self.function(workspace, *args, **kwargs)


if TYPE_CHECKING:  # so that the arguments of each call are checked
    from robotrue.app.workbench import (
        cell_editor,
        cell_scene,
        drilling_import,
        file_imports,
        model_views,
        probing_begin,
        probing_entry,
        probing_view,
        program_judgement,
        sample_project,
    )
else:
    cell_editor = LateFile("cell_editor")
    cell_scene = LateFile("cell_scene")
    drilling_import = LateFile("drilling_import")
    file_imports = LateFile("file_imports")
    model_views = LateFile("model_views")
    probing_begin = LateFile("probing_begin")
    probing_entry = LateFile("probing_entry")
    probing_view = LateFile("probing_view")
    program_judgement = LateFile("program_judgement")
    sample_project = LateFile("sample_project")

list_presets = cell_editor.list_presets
describe_cell = cell_editor.describe_cell
save_cell_text = InWorkspace(cell_editor.save_cell_text)
read_cell_text = InWorkspace(cell_editor.read_cell_text)
add_sample_project = InWorkspace(sample_project.add_sample_project)

import_cell = InWorkspace(file_imports.import_cell)
import_program = InWorkspace(file_imports.import_program)
import_measurements = InWorkspace(file_imports.import_measurements)
import_check_poses = InWorkspace(file_imports.import_check_poses)
import_drilling = InWorkspace(drilling_import.import_drilling)
preview_file = InWorkspace(file_imports.preview_file)

show_model = InWorkspace(model_views.show_model)
judge_measurement = InWorkspace(model_views.judge_measurement)
list_rows = InWorkspace(model_views.list_rows)
judge_program = InWorkspace(program_judgement.judge_program)
show_plan = InWorkspace(cell_scene.show_plan)
draw_cell = InWorkspace(cell_scene.draw_cell)
draw_model = InWorkspace(cell_scene.draw_model)
draw_measurement = InWorkspace(cell_scene.draw_measurement)

begin_probing = InWorkspace(probing_begin.begin_probing)
show_probing = InWorkspace(probing_view.show_probing)
enter_reading = InWorkspace(probing_entry.enter_reading)
decide_reading = InWorkspace(probing_entry.decide_reading)
import_readings = InWorkspace(probing_entry.import_readings)
finish_probing = InWorkspace(probing_entry.finish_probing)
write_readings = InWorkspace(probing_entry.write_readings)
