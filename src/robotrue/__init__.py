"""robotrue makes an industrial robot cut where the CAM planned.

::

    import robotrue as rt

    cell = rt.read_cell("cell.toml")
    model = rt.calibrate(cell, "calibration.csv")
    print(rt.validate(model, "held_out.csv").summary())
    rt.compensate(model, "part.src").save("part_compensated.src")

A name is imported when it is first used. The options are those of the command of the same name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from robotrue.errors import RobotrueError as RobotrueError
from robotrue.version import __version__ as __version__

if TYPE_CHECKING:
    from robotrue.library.any_operation import OperationResult as OperationResult
    from robotrue.library.any_operation import operations as operations
    from robotrue.library.any_operation import run as run
    from robotrue.library.cell_object import RobotCell as RobotCell
    from robotrue.library.cell_object import make_cell as make_cell
    from robotrue.library.cell_object import read_cell as read_cell
    from robotrue.library.cell_object import robots as robots
    from robotrue.library.measurement_object import Measurements as Measurements
    from robotrue.library.measurement_object import read_measurements as read_measurements
    from robotrue.library.model_object import Model as Model
    from robotrue.library.model_object import calibrate as calibrate
    from robotrue.library.model_object import load_model as load_model
    from robotrue.library.model_object import transfer as transfer
    from robotrue.library.plan_object import PosesToMeasure as PosesToMeasure
    from robotrue.library.plan_object import plan as plan
    from robotrue.library.practice import write_practice_cell as write_practice_cell
    from robotrue.library.prediction_object import PredictedErrors as PredictedErrors
    from robotrue.library.program_object import RewrittenProgram as RewrittenProgram
    from robotrue.library.program_object import RobotProgram as RobotProgram
    from robotrue.library.program_object import compensate as compensate
    from robotrue.library.program_object import read_program as read_program
    from robotrue.library.validation_object import Validation as Validation
    from robotrue.library.validation_object import validate as validate

HOMES: Final = {
    "cell_object": ("RobotCell", "make_cell", "read_cell", "robots"),
    "measurement_object": ("Measurements", "read_measurements"),
    "model_object": ("Model", "calibrate", "load_model", "transfer"),
    "any_operation": ("OperationResult", "operations", "run"),
    "plan_object": ("PosesToMeasure", "plan"),
    "practice": ("write_practice_cell",),
    "prediction_object": ("PredictedErrors",),
    "program_object": ("RewrittenProgram", "RobotProgram", "compensate", "read_program"),
    "validation_object": ("Validation", "validate"),
}
"""Modules of the library, and the names that each gives here."""

if not TYPE_CHECKING:  # a type checker takes the names from above, and refuses others

    def __getattr__(name: str) -> object:
        """Returns a name of the library; its module is imported now."""
        from importlib import import_module

        for module, names in HOMES.items():
            if name in names:
                found = getattr(import_module(f"robotrue.library.{module}"), name)
                globals()[name] = found
                return found
        raise AttributeError(f"module 'robotrue' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Returns the names of the library, and no module."""
    return sorted(["RobotrueError", "__version__", *(n for names in HOMES.values() for n in names)])
