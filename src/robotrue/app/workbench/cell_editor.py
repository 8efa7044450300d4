"""A cell from a form or from its text: previewed before saving, errors beside the field."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from robotrue.app.workbench.arm_body import answer
from robotrue.app.workbench.arm_file import ArmFile, read_arm
from robotrue.cell.cell import Cell
from robotrue.cell.config import parse_cell
from robotrue.cell.toml_edit import round_digits, write_toml
from robotrue.core.json_values import plain_text
from robotrue.core.units import MM, UM
from robotrue.errors import ConfigurationError, FormatError, ModelMismatchError, ShapeError
from robotrue.measurement.tracker import DEFAULT_SPECIFICATION
from robotrue.robot.forward import wrist_reach
from robotrue.robot.makers import MAKERS
from robotrue.robot.presets import preset, preset_names, rated_payload
from robotrue.store import cells, items
from robotrue.store.layout import copy_files
from robotrue.store.nouns import CELL, CellRecord
from robotrue.store.workspace import Workspace, transaction

BOXES: Final = 8
"""Boxes that the form states; a cell.toml may hold more."""
JOINTS: Final = 7
"""Most joints that the form states a stiffness of."""
OPTIONAL_FIELDS: Final[Mapping[str, tuple[float, float]]] = {
    **{f"reflector_{axis}_mm": (-3000.0, 3000.0) for axis in "xyz"},
    **{f"tracker_{axis}_mm": (-50_000.0, 50_000.0) for axis in "xyz"},
    "floor_z_mm": (-5000.0, 1000.0),
    **{
        f"box{number}_{corner}_{axis}_mm": (-20_000.0, 20_000.0)
        for number in range(1, BOXES + 1)
        for corner in ("low", "high")
        for axis in "xyz"
    },
    **{f"stiffness_{joint}_MNm_per_rad": (1e-4, 1000.0) for joint in range(1, JOINTS + 1)},
}
"""Least and most of each number that may be left blank: it is then not stated."""


def _find_incomplete_fields(values: Mapping[str, float], dof: int) -> dict[str, dict[str, object]]:
    """Returns a fault for each blank field of a point, a box or a stiffness that is half stated."""
    faults: dict[str, dict[str, object]] = {}
    for names in _list_groups(dof):
        missing = [name for name in names if name not in values]
        if 0 < len(missing) < len(names):
            faults |= {name: {"kind": "incomplete"} for name in missing}
    for number in range(1, BOXES + 1):
        low, high = (_read_point(values, f"box{number}_{side}") for side in ("low", "high"))
        if not low or not high:
            continue
        for axis, least, largest in zip("xyz", low, high, strict=True):
            if not least < largest:
                faults[f"box{number}_high_{axis}_mm"] = {"kind": "flat"}
    return faults


def _state_surroundings(
    values: Mapping[str, float], dof: int, frame: str
) -> dict[str, dict[str, object] | list[dict[str, object]]]:
    """Returns the keys that the optional fields add to the tables of a cell.toml.

    Args:
        values: The fields that are stated, complete.
        dof: Joints of the arm.
        frame: Frame of the measured positions, ``base`` or ``unknown``.
    """
    tables: dict[str, dict[str, object] | list[dict[str, object]]] = {}
    stiffness = [values.get(name) for name in _list_stiffness(dof)]
    stated = [round(each * 1e6, 3) for each in stiffness if each is not None]
    if stated:
        tables["robot"] = {"stiffness_Nm_per_rad": stated}
    if reflector := _read_point(values, "reflector"):
        tables["target"] = {"xyz_mm": reflector}
    if place := _read_point(values, "tracker"):
        # Measured positions in the base frame share it with the instrument's own place.
        tables["tracker"] = {"place_mm" if frame == "unknown" else "xyz_mm": place}
    obstacles: list[dict[str, object]] = []
    if "floor_z_mm" in values:
        height = values["floor_z_mm"]
        obstacles.append({"name": "floor", "below_mm": [[0.0, 0.0, height], [0.0, 0.0, 1.0]]})
    for number in range(1, BOXES + 1):
        low, high = (_read_point(values, f"box{number}_{side}") for side in ("low", "high"))
        if low and high:
            obstacles.append({"name": f"box {number}", "box_mm": [low, high]})
    if obstacles:
        tables["obstacle"] = obstacles
    return tables


def _list_groups(dof: int) -> list[list[str]]:
    """The fields that are stated together or not at all."""
    points = [[f"{what}_{axis}_mm" for axis in "xyz"] for what in ("reflector", "tracker")]
    boxes = [
        [f"box{number}_{corner}_{axis}_mm" for corner in ("low", "high") for axis in "xyz"]
        for number in range(1, BOXES + 1)
    ]
    return [*points, *boxes, _list_stiffness(dof)]


def _list_stiffness(dof: int) -> list[str]:
    return [f"stiffness_{joint}_MNm_per_rad" for joint in range(1, dof + 1)]


def _read_point(values: Mapping[str, float], name: str) -> list[float]:
    point = [values.get(f"{name}_{axis}_mm") for axis in "xyz"]
    stated = [each for each in point if each is not None]
    return stated if len(stated) == len(point) else []


HEADING: Final = "# Made from a preset; change and extend it.\n"
HEADING_OF_FILE: Final = "# Made from the file of an arm; change and extend it.\n"
USUAL: Final[Mapping[str, float]] = {
    "repeatability_mm": 0.06,
    "sigma_um": round_digits(
        DEFAULT_SPECIFICATION.range_bound / DEFAULT_SPECIFICATION.divisor / UM
    ),
    "sigma_um_per_m": round_digits(
        DEFAULT_SPECIFICATION.range_bound_per_m / DEFAULT_SPECIFICATION.divisor / UM
    ),
}
"""What a cell.toml that does not state them means."""
FIELDS: Final[Mapping[str, tuple[float, float, float]]] = {
    "tool_x_mm": (0.0, -3000.0, 3000.0),
    "tool_y_mm": (0.0, -3000.0, 3000.0),
    "tool_z_mm": (0.0, -3000.0, 3000.0),
    "tool_a_deg": (0.0, -360.0, 360.0),
    "tool_b_deg": (0.0, -360.0, 360.0),
    "tool_c_deg": (0.0, -360.0, 360.0),
    "mass_kg": (0.0, 0.0, 2000.0),
    "centre_x_mm": (0.0, -2000.0, 2000.0),
    "centre_y_mm": (0.0, -2000.0, 2000.0),
    "centre_z_mm": (0.0, -2000.0, 2000.0),
    "repeatability_mm": (USUAL["repeatability_mm"], 0.001, 1.0),
    "sigma_um": (USUAL["sigma_um"], 0.0, 1000.0),
    "sigma_um_per_m": (USUAL["sigma_um_per_m"], 0.0, 1000.0),
}
"""Default, lower and upper limit of each number."""
LARGEST: Final = 200_000
"""Characters of a cell.toml."""


def list_presets() -> bytes:
    """Returns every preset with reach and rated payload, and the fields of the form."""
    found = []
    for name in preset_names():
        robot = preset(name)
        found.append(
            {
                "name": name,
                "joints": robot.dof,
                "reach_mm": wrist_reach(robot) / MM,
                "rated_kg": rated_payload(name),
            }
        )
    fields: list[dict[str, object]] = [
        {"name": name, "usual": usual, "least": least, "most": most}
        for name, (usual, least, most) in FIELDS.items()
    ]
    fields += [
        {"name": name, "usual": None, "least": least, "most": most}
        for name, (least, most) in OPTIONAL_FIELDS.items()
    ]
    return answer({"presets": found, "fields": fields, "makers": list(MAKERS)})


def describe_cell(stated: Mapping[str, object]) -> bytes:
    """Returns the cell.toml of a form, or what is wrong with which field.

    Args:
        stated: ``robot``, ``frame`` and the fields, as typed; in place of ``robot`` the path of a
            file ``arm``, with ``convention`` and ``maker``.
    """
    values, faults = _numbers(stated)
    robot = str(stated.get("robot", ""))
    try:
        arm = _read_stated_arm(stated)
        model = None if arm is None else _parse({"schema": 1, "robot": arm.table}, arm.files).robot
    except (ConfigurationError, FormatError, ShapeError) as error:
        faults["arm" if stated.get("arm") else "robot"] = {"kind": "refused", "text": str(error)}
        return answer({"faults": faults, "text": "", "cautions": {}})
    if arm is None or model is None:
        faults["robot"] = {"kind": "preset"}
        return answer({"faults": faults, "text": "", "cautions": {}})
    faults = {**_find_incomplete_fields(values, model.dof), **faults}
    if values["sigma_um"] == 0.0 and values["sigma_um_per_m"] == 0.0:
        faults["sigma_um"] = {"kind": "exact"}
    if math.dist((values["centre_x_mm"], values["centre_y_mm"], values["centre_z_mm"]), (0, 0, 0)):
        if values["mass_kg"] == 0.0:
            faults["mass_kg"] = {"kind": "massless"}
    known = {"joints": model.dof, "arm_files": list(arm.files)}
    if faults:
        return answer({"faults": faults, "text": "", "cautions": {}, **known})
    rated = rated_payload(robot) if robot else None
    over = rated is not None and values["mass_kg"] > rated
    cautions = {"mass_kg": {"kind": "rated", "most": rated}} if over else {}
    try:
        tables = _cell_tables(arm.table, model.dof, str(stated.get("frame", "base")), values)
        _parse(tables, arm.files)
    except (ConfigurationError, ShapeError) as error:
        faults[_find_field(error.message)] = {"kind": "refused", "text": error.message}
        return answer({"faults": faults, "text": "", "cautions": {}, **known})
    text = (HEADING if robot else HEADING_OF_FILE) + write_toml(tables)
    return answer({"faults": {}, "text": text, "cautions": cautions, **known})


def _read_stated_arm(stated: Mapping[str, object]) -> ArmFile | None:
    """The arm of a form: a preset, or the file that was sent; None: neither is known."""
    robot, sent = str(stated.get("robot", "")), stated.get("arm")
    if sent:
        convention, maker = (str(stated.get(key) or "") for key in ("convention", "maker"))
        return read_arm(Path(str(sent)), convention=convention or "dh", maker=maker)
    return ArmFile(table={"preset": robot}) if robot in preset_names() else None


def _parse(tables: Mapping[str, object], files: Mapping[str, bytes]) -> Cell:
    return parse_cell(write_toml(tables).encode(), "cell.toml", files=files)


def save_cell_text(
    workspace: Workspace,
    text: str,
    name: str,
    id: str,
    version: int,
    companions: Sequence[Path] = (),
) -> CellRecord:
    """Returns the record of a cell.toml's text: a new cell, or a new version of one.

    Args:
        workspace: Of the cell.
        text: Of the cell.toml.
        name: Of a new cell.
        id: Of the cell that gets a new version; empty: none.
        version: Its version that was changed.
        companions: Files that the text of a new cell names.

    Raises:
        ModelMismatchError: Another user changed it meanwhile.
    """
    if len(text) > LARGEST:
        raise ConfigurationError(f"a cell.toml of {len(text)} characters, expected {LARGEST:,}.")
    if not plain_text(text):
        raise ConfigurationError("the text holds a NUL or half a character.", hint="type it again.")
    with TemporaryDirectory() as place:
        path = Path(place) / "cell.toml"
        if not id:
            cells.require_beside(text, [each.name for each in companions])
            for each in companions:
                shutil.copyfile(each, Path(place) / each.name)
            path.write_text(text, encoding="utf-8")
            return cells.add(workspace, path, name=name)
        before = items.get(workspace, CELL, id)
        copy_files(workspace, before, Path(place), cells.COMPANION)
        cells.require_beside(text, {each.name for each in before.files(cells.COMPANION)})
        path.write_text(text, encoding="utf-8")
        with transaction(workspace) as into:
            record = cells.add(into, path, name=before.name, note=before.note, id=id)
            if record.version != version + 1:
                raise ModelMismatchError(
                    f"the cell was changed meanwhile: it is at version {record.version - 1}, "
                    f"not {version}.",
                    hint="open it again; your change was not saved.",
                )
        return record


def read_cell_text(workspace: Workspace, id: str, version: int) -> bytes:
    """Returns the text of a cell's file."""
    record = items.get(workspace, CELL, id, version=version)
    (file,) = record.files(cells.FILE)
    return workspace.content(file.sha256)


def _numbers(stated: Mapping[str, object]) -> tuple[dict[str, float], dict[str, dict[str, object]]]:
    values: dict[str, float] = {}
    faults: dict[str, dict[str, object]] = {}
    allowed = {name: (least, most) for name, (_, least, most) in FIELDS.items()}
    for name, (least, most) in {**allowed, **OPTIONAL_FIELDS}.items():
        typed = stated.get(name)
        words = "" if typed is None else str(typed).strip().replace(",", ".").replace("−", "-")
        if name in FIELDS:
            values[name] = FIELDS[name][0]
        if not words:
            continue
        try:
            value = float(words)
        except ValueError:
            faults[name] = {"kind": "number"}
            continue
        if not least <= value <= most:
            faults[name] = {"kind": "range", "least": least, "most": most}
            continue
        values[name] = value
    return values, faults


def _cell_tables(
    robot: Mapping[str, object], dof: int, frame: str, values: Mapping[str, float]
) -> dict[str, object]:
    """Returns the tables of the cell.toml that a form states, in its own keys."""
    tracker: dict[str, object] = {"frame": "unknown" if frame == "unknown" else "base"}
    if any(values[key] != USUAL[key] for key in ("sigma_um", "sigma_um_per_m")):
        tracker |= {key: values[key] for key in ("sigma_um", "sigma_um_per_m")}
    tables: dict[str, object] = {
        "schema": 1,
        "robot": dict(robot),
        "tool": {
            "xyz_mm": [values[f"tool_{axis}_mm"] for axis in "xyz"],
            "abc_deg": [values[f"tool_{angle}_deg"] for angle in "abc"],
        },
        "payload": {
            "mass_kg": values["mass_kg"],
            "centre_of_mass_mm": [values[f"centre_{axis}_mm"] for axis in "xyz"],
        },
        "repeatability": {"mm": values["repeatability_mm"]},
        "tracker": tracker,
    }
    for key, added in _state_surroundings(values, dof, frame).items():
        stated = tables.get(key)
        if isinstance(stated, dict) and isinstance(added, dict):
            tables[key] = {**stated, **added}
        else:
            tables[key] = added
    return tables


def _find_field(message: str) -> str:
    """The field named by a refusal of the cell."""
    for word, field in (
        ("preset", "robot"),
        ("mass", "mass_kg"),
        ("repeatability", "repeatability_mm"),
        ("sigma", "sigma_um"),
        ("tool", "tool_x_mm"),
    ):
        if word in message:
            return field
    return "robot"
