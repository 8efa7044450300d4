"""Laws of all operations: light to import, one default each, one way from every shell."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest

from robotrue.app.job_files import is_result_folder, job_fields
from robotrue.app.job_parameters import parameters_model, stated_parameters
from robotrue.app.operations.calibrate import CalibrateRequest
from robotrue.app.registry import FOLDER, job_operations, listings, operation_of
from robotrue.app.request import JOB, NAMED, InputFile, ItemVersion, Output, fields_of
from robotrue.calibration.methods import METHODS
from robotrue.errors import ConfigurationError

HEAVY = "numpy scipy pandas numba sklearn matplotlib sqlalchemy rich"
NAMES = [each.name for each in listings()]


def in_new_process(code: str) -> str:
    found = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    return found.stdout.strip()


def test_operations_are_light_to_import() -> None:
    code = (
        "import sys\n"
        "from robotrue.app.job_parameters import parameters_model\n"
        "from robotrue.app.registry import job_operations\n"
        "[parameters_model(each) for each in job_operations().values()]\n"
        f"print([name for name in {HEAVY.split()!r} if name in sys.modules])"
    )
    assert in_new_process(code) == "[]"


def test_the_list_of_commands_imports_no_operation() -> None:
    code = (
        "import contextlib, io, sys\n"
        "from robotrue.cli.main import run\n"
        "sys.argv = ['robotrue', '--help']\n"
        "with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):\n"
        "    run()\n"
        "print([name for name in ('pydantic', 'numpy') if name in sys.modules])"
    )
    assert in_new_process(code) == "[]"


def test_every_operation_is_listed() -> None:
    texts = [path.read_text("utf-8") for path in FOLDER.glob("*.py")]
    assert len(NAMES) == len(set(NAMES)) == sum(text.count("\n@operation(") for text in texts)


@pytest.mark.parametrize("name", NAMES)
def test_an_operation_describes_itself(name: str) -> None:
    listing = next(each for each in listings() if each.name == name)
    assert listing.help[0].isupper()
    assert listing.help.endswith(".")
    operation = operation_of(name)
    for field in fields_of(operation.request):
        assert field.entry.help, f"{name}.{field.name} has no help"
        if isinstance(field.entry, Output) and field.is_in(JOB):
            assert field.entry.saved_as, f"{name}.{field.name} is a parameter that nothing saves"
        if isinstance(field.entry, InputFile) and operation.save is not None:
            assert not field.required, f"a job of {name} cannot have {field.name}"


@pytest.mark.parametrize("name", job_operations())
def test_a_job_has_the_defaults_of_its_request(name: str) -> None:
    operation = operation_of(name)
    needed: dict[str, Any] = {
        field.name: ["x"] if field.many else 1.0 if field.kind is float else "x"
        for field in job_fields(operation)
        if field.is_required(JOB) and not isinstance(field.entry, Output)
    }
    request = stated_parameters(operation, needed).request
    for field in fields_of(operation.request):
        if field.name not in needed and not isinstance(field.entry, Output):
            default = getattr(request, field.name)
            assert default == field.default or is_result_folder(field)
    schema = parameters_model(operation).model_json_schema()
    assert schema["additionalProperties"] is False
    assert set(NAMED) <= set(schema["properties"])
    assert set(schema.get("required", ())) == set(needed)


def test_items_of_a_job_are_pinned_to_a_version() -> None:
    stated = stated_parameters(
        operation_of("calibrate"),
        {"cell": {"id": "left", "version": 2}, "measurements": "cal", "name": "m", "note": None},
    )
    request = stated.request
    assert isinstance(request, CalibrateRequest)
    assert request.cell == ItemVersion(id="left", version=2)
    assert request.measurements == (ItemVersion(id="cal"),)
    assert request.output == Path("model.rtm")
    assert request.report == Path("report.html")
    assert (stated.naming.name, stated.naming.note) == ("m", "")


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"shoe": 43},
            "unknown parameter 'shoe'; known are cell, mapping, measurements, method, name",
        ),
        ({"measurements": ["a"]}, "the parameter 'cell' is missing: a cell."),
        ({"cell": "a"}, "the parameter 'measurements' is missing: a measurement."),
        ({"cell": "a", "measurements": []}, "is [], expected one measurement or more"),
        ({"cell": 7, "measurements": ["a"]}, "parameter 'cell' is 7, expected the id of a cell"),
        ({"cell": "a", "measurements": ["a"], "method": "best"}, "method 'best', expected auto, "),
        ({"cell": "a", "measurements": ["a"], "name": 3}, "parameter 'name' is 3, expected text"),
        ({"cell": "a", "measurements": ["a"], "output": "/etc/x"}, "unknown parameter 'output'"),
    ],
)
def test_wrong_parameters_are_refused(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        stated_parameters(operation_of("calibrate"), parameters)
    assert message in str(refused.value)


def test_every_method_of_calibration_can_be_asked_for() -> None:
    field = CalibrateRequest.model_fields["method"]
    assert set(get_args(field.annotation)) == {"auto", *METHODS}
