"""``import robotrue as rt``: the same requests as the command line, on objects and arrays."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robotrue as rt
from robotrue.app.files_context import FilesContext
from robotrue.app.registry import operation_of
from robotrue.app.reporting import Silent
from robotrue.library.operation_call import command_fields

ROOT = Path(__file__).resolve().parents[2]
NAMES = [
    "Measurements", "Model", "OperationResult", "PosesToMeasure", "PredictedErrors",
    "RewrittenProgram", "RobotCell", "RobotProgram", "RobotrueError", "Validation",
    "__version__", "calibrate", "compensate", "load_model", "make_cell", "operations", "plan",
    "read_cell", "read_measurements", "read_program", "robots", "run", "transfer", "validate",
    "write_practice_cell",
]  # fmt: skip


def run_on_files(name: str, **fields: object):
    operation = operation_of(name)
    return operation.run(operation.request.model_validate(fields), FilesContext(Silent()))


def test_completion_shows_the_names_of_the_library_and_no_module():
    assert dir(rt) == NAMES
    assert all(hasattr(rt, name) for name in NAMES)
    with pytest.raises(AttributeError, match="no attribute 'calibrat'"):
        _ = rt.calibrat


def test_the_type_checker_sees_the_same_names():
    source = (ROOT / "src/robotrue/__init__.py").read_text()
    assert all(f" as {name}\n" in source for name in NAMES)


def test_importing_the_package_loads_nothing_heavy():
    heavy = "numpy", "scipy", "pandas", "pydantic", "matplotlib", "numba"
    code = f"import sys, robotrue; dir(robotrue); print([m for m in {heavy} if m in sys.modules])"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["calibrate", "transfer", "validate", "compensate", "plan"])
def test_a_function_has_the_options_and_the_defaults_of_the_command(name):
    shown = inspect.signature(getattr(rt, name)).parameters
    fields = {field.name: field for field in command_fields(name)}
    stated = {key: each for key, each in shown.items() if each.kind is each.KEYWORD_ONLY}
    options = {key: each for key, each in stated.items() if key in fields}
    assert len(options) >= 2
    for key, parameter in options.items():
        assert parameter.default == fields[key].default
        assert f"``{key}``" in getattr(rt, name).__doc__ or f"{key}: " in getattr(rt, name).__doc__


def test_the_option_types_are_those_of_the_requests():
    command = [sys.executable, ROOT / "scripts" / "library_options.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stderr


def test_a_saved_model_has_the_bytes_that_the_command_writes(practice, model, tmp_path):
    run_on_files(
        "calibrate",
        cell=practice / "cell.toml",
        measurements=(practice / "calibration.csv",),
        output=tmp_path / "command.robotrue",
        method="geometric",
    )
    cell = rt.read_cell(practice / "cell.toml")
    data = rt.read_measurements(cell, practice / "calibration.csv")
    rt.calibrate(cell, data, method="geometric").save(tmp_path / "objects.robotrue")
    model.save(tmp_path / "paths.robotrue")
    wanted = (tmp_path / "command.robotrue").read_bytes()
    assert (tmp_path / "objects.robotrue").read_bytes() == wanted
    assert (tmp_path / "paths.robotrue").read_bytes() == wanted
    loaded = rt.load_model(tmp_path / "paths.robotrue")
    assert loaded.summary().splitlines()[0].startswith("SIMULATED")
    assert loaded.method == "geometric"


def test_a_compensated_program_has_the_bytes_that_the_command_writes(practice, model, tmp_path):
    model.save(tmp_path / "m.robotrue")
    (tmp_path / "by_command").mkdir()
    run_on_files(
        "compensate",
        model=tmp_path / "m.robotrue",
        program=(practice / "part.src",),
        output=tmp_path / "by_command",
    )
    rewritten = rt.compensate(model, practice / "part.src")
    rewritten.save(tmp_path / "new.src")
    wanted = (tmp_path / "by_command" / "part.src").read_bytes()
    assert (tmp_path / "new.src").read_bytes() == wanted
    assert wanted != (practice / "part.src").read_bytes()
    table = rewritten.to_dataframe()
    assert (table["error_before_um"].dropna() > 500).all()
    assert (table["error_after_um"].dropna() < 100).all()
    with pytest.raises(rt.RobotrueError, match="compensated already"):
        rt.compensate(model, tmp_path / "new.src")
    with pytest.raises(rt.RobotrueError, match="the original program"):
        rewritten.save(practice / "part.src")


def test_files_tables_and_arrays_give_the_same_measurements(practice):
    cell = rt.read_cell(practice / "cell.toml")
    data = rt.read_measurements(cell, practice / "calibration.csv")
    table = rt.read_measurements(cell, data.to_dataframe())
    arrays = rt.read_measurements(cell, joints_deg=data.joints_deg, points_mm=data.points_mm)
    for other in (table, arrays):
        assert np.abs(other.rows.joints - data.rows.joints).max() < 1e-15
        assert np.abs(other.rows.position - data.rows.position).max() < 1e-15
    assert np.allclose(table.rows.covariance, data.rows.covariance, rtol=1e-12, atol=0.0)
    assert data.simulated
    assert table.simulated, "a table of simulated poses is marked"
    assert len(data[::4]) == 20
    high = data.points_mm[:, 2] > np.median(data.points_mm[:, 2])
    assert len(data[high]) == 40
    with pytest.raises(rt.RobotrueError, match="belong together"):
        rt.read_measurements(cell, joints_deg=data.joints_deg)
    with pytest.raises(rt.RobotrueError, match="79 of points_mm"):
        rt.read_measurements(cell, joints_deg=data.joints_deg, points_mm=data.points_mm[1:])


def test_a_prediction_is_that_of_the_command_with_all_its_digits(practice, model, tmp_path):
    cell = rt.read_cell(practice / "cell.toml")
    data = rt.read_measurements(cell, practice / "held_out.csv")
    model.save(tmp_path / "m.robotrue")
    output = tmp_path / "p.csv"
    queries = practice / "held_out.csv"
    run_on_files("predict", model=tmp_path / "m.robotrue", queries=queries, output=output)
    written = np.loadtxt(output, delimiter=",", skiprows=2)
    predicted = model.predict(joints_deg=data.joints_deg)
    assert np.abs(written[:, :3] - predicted.error_mm).max() < 1e-6
    assert np.abs(written[:, 3:] - predicted.sigma_mm).max() < 1e-6
    after = data.points_mm - predicted.commanded_mm - predicted.error_mm
    report = rt.validate(model, data)
    assert np.abs(after - report.after_mm).max() < 1e-6
    heavy = model.predict(joints_deg=data.joints_deg[0], payload_kg=0.0)
    assert len(heavy) == 1


def test_everything_has_a_summary_a_table_a_picture_and_a_short_name(practice, model):
    cell = rt.read_cell(practice / "cell.toml")
    data = rt.read_measurements(cell, practice / "held_out.csv")
    shown = [
        cell,
        data,
        model,
        model.predict(data.to_dataframe()),
        rt.validate(model, data),
        rt.read_program(practice / "part.src"),
        rt.compensate(model, practice / "part.src"),
        rt.plan(cell, poses=4, candidates=60),
        rt.run("drift", model=model, measurements=data),
    ]
    for each in shown:
        assert len(repr(each)) < 120
        assert len(each.summary().splitlines()) >= 3
        assert len(each.to_dataframe()) > 0
        html = each._repr_html_()
        assert html.startswith("<")
        assert ("SIMULATED" in each.summary()) == ("SIMULATED" in html) == each.simulated
        assert "/robotrue-" not in each.summary(), "no temporary file is named"
    assert [each.simulated for each in shown] == [0, 1, 1, 1, 1, 0, 1, 0, 1]
    assert shown[3].plot()._repr_png_().startswith(b"\x89PNG")
    assert all(each.plot().get_figheight() > 2.0 for each in shown[:8])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"metod": "gp"}, "no option 'metod'; it has .*Try: method=..."),
        ({"method": "gpx"}, "method 'gpx', expected auto, nominal"),
        ({"report": "no/such/page.html"}, "the folder no/such does not exist"),
    ],
)
def test_a_wrong_option_is_refused_before_any_work(practice, options, message):
    with pytest.raises(rt.RobotrueError, match=message):
        rt.calibrate(practice / "cell.toml", practice / "calibration.csv", **options)


def test_an_error_about_a_table_names_the_table_and_no_temporary_folder(practice, model):
    with pytest.raises(rt.RobotrueError, match=r"^queries.csv: 3 joint columns, .* has 6 joints"):
        model.predict(joints_deg=[1.0, 2.0, 3.0])
    table = model.to_dataframe()
    with pytest.raises(rt.RobotrueError, match=r"^table.csv:1: columns of no known layout"):
        rt.read_measurements(practice / "cell.toml", table)


def test_no_measurements_and_services_are_refused(practice):
    with pytest.raises(rt.RobotrueError, match="calibrate needs measurements"):
        rt.calibrate(practice / "cell.toml")
    with pytest.raises(rt.RobotrueError, match="runs until it is stopped"):
        rt.run("sense_run", cell=practice / "cell.toml")
    assert "register" in rt.operations()


def test_a_cell_is_made_of_a_robot_name(tmp_path):
    assert "UR5" in rt.robots()
    cell = rt.make_cell("ur5", tool_xyz_mm=(0, 0, 31), tracker_frame="unknown", payload_kg=1.5)
    assert cell.robot == "UR5"
    cell.save(tmp_path / "cell.toml")
    again = rt.read_cell(tmp_path / "cell.toml")
    assert again.summary().splitlines()[1:] == cell.summary().splitlines()[1:]
    assert "payload kg               1.5" in cell.summary()
    with pytest.raises(rt.RobotrueError, match="no robot preset"):
        rt.make_cell("UR99")


def test_a_fleet_is_given_as_models_files_or_folders(practice, model, tmp_path):
    cell = rt.read_cell(practice / "cell.toml")
    sister = rt.read_measurements(cell, practice / "held_out.csv")
    model.save(tmp_path / "arm.robotrue")
    objects = rt.transfer(cell, fleet=[model])
    files = rt.transfer(cell, fleet=tmp_path / "arm.robotrue")
    joints = sister.joints_deg[:3]
    ours, theirs = (each.predict(joints_deg=joints) for each in (objects, files))
    assert np.array_equal(ours.error_mm, theirs.error_mm)
    assert np.array_equal(ours.sigma_mm, theirs.sigma_mm)


def test_a_hierarchical_plan_is_refused_before_its_work(practice):
    with pytest.raises(rt.RobotrueError, match=r"one list of poses.*Try: rt.run\(\"plan\""):
        rt.plan(practice / "no-such-cell.toml", method="hierarchical")


def test_a_registered_cell_names_the_file_of_the_model_and_no_temporary_one(
    practice, model, points, tmp_path
):
    fields = {"points": points, "output": tmp_path / "registered.toml", "fit": "frame"}
    with pytest.raises(rt.RobotrueError, match=r"no file. Try: model.save"):
        rt.run("register", cell=model, **fields)
    model.save(tmp_path / "arm.robotrue")
    loaded = rt.load_model(tmp_path / "arm.robotrue")
    rt.run("register", cell=loaded, **fields)
    registered = rt.read_cell(tmp_path / "registered.toml")
    assert registered.cell.part is not None
    assert registered.cell.part.model_file == "arm.robotrue"
    rt.compensate(loaded, practice / "part.src", cell=registered)
    (tmp_path / "elsewhere").mkdir()
    saved = (tmp_path / "arm.robotrue").read_bytes()
    registered.save(tmp_path / "elsewhere" / "cell.toml")
    again = rt.read_cell(tmp_path / "elsewhere" / "cell.toml")
    assert again.cell.part is not None
    assert again.cell.text == registered.cell.text
    before, after = registered.cell.part.frames[0], again.cell.part.frames[0]
    np.testing.assert_array_equal(after.T_base_part, before.T_base_part)
    assert (tmp_path / "elsewhere" / "arm.robotrue").read_bytes() == saved
    rt.compensate(tmp_path / "elsewhere" / "arm.robotrue", practice / "part.src", cell=again)
    rt.calibrate(practice / "cell.toml", practice / "held_out.csv", method="geometric").save(
        tmp_path / "arm.robotrue"
    )
    with pytest.raises(rt.RobotrueError, match=r"the file holds .*, the model that was loaded"):
        rt.run("register", cell=loaded, **fields)
