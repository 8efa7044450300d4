"""Identities of models and programs: kept, compared, refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.model_identity import ModelIdentity, identity_from, require_same_model
from robotrue.errors import FormatError, ModelMismatchError
from robotrue.program.identity import (
    ProgramIdentity,
    identity_path,
    read_identity,
    require_compensable,
    write_identity,
)
from robotrue.robot.model import nominal_identity
from robotrue.robot.presets import preset

NOMINAL = ModelIdentity(kind="nominal", robot="KR", sha256="a" * 64)
MODEL = ModelIdentity(kind="calibrated", robot="KR", sha256="b" * 64)
DATA = b"LIN {X 1}\n"


def test_the_nominal_arm_is_its_geometry() -> None:
    robot = preset("KUKA KR160 R1570")
    own = nominal_identity(robot)
    tool = np.eye(4)
    tool[2, 3] = 0.2
    assert own.same(nominal_identity(robot.with_tool(tool)))
    assert own.same(nominal_identity(replace(robot, link_mass=np.ones(6), name="another name")))
    assert own.same(nominal_identity(replace(robot, a=np.deg2rad(np.rad2deg(robot.a)))))
    longer = robot.d + 1e-6 * np.eye(6)[5]
    assert not own.same(nominal_identity(replace(robot, d=longer)))
    assert not own.same(nominal_identity(preset("UR10")))


def test_documents_and_what_is_no_document() -> None:
    assert identity_from(MODEL.document()) == MODEL
    with pytest.raises(ModelMismatchError, match="kind 'measured'"):
        identity_from({"kind": "measured", "sha256": "1"})


@pytest.mark.parametrize(("made", "used", "cost"), [
    (MODEL, NOMINAL, "Probing with a calibrated and machining with the nominal arm leaves 1.15"),
    (NOMINAL, MODEL, "Probing with the nominal and machining with a calibrated arm leaves 1.12"),
    (MODEL, replace(MODEL, sha256="c" * 64), "leaves 1.12 to 1.15 mm rms"),
])  # fmt: skip
def test_the_refusal_quotes_the_cost(made: ModelIdentity, used: ModelIdentity, cost: str) -> None:
    with pytest.raises(ModelMismatchError) as caught:
        require_same_model(made, used, what="the part frame", source="cell.toml")
    assert caught.value.message.startswith(f"the part frame was made with {made}")
    assert cost in caught.value.message
    assert "0.19 mm (nominal) or 0.09 mm (calibrated)" in caught.value.message
    assert caught.value.source == "cell.toml"
    require_same_model(made, replace(made, robot="another name"), what="the part frame")


def test_a_program_keeps_its_identity_until_it_is_edited(tmp_path: Path) -> None:
    program = tmp_path / "job.src"
    made = ProgramIdentity(model=MODEL, compensated=False, part="front", made_from="job.apt")
    write_identity(program, DATA, made)
    assert identity_path(program).name == "job.src.identity.json"
    assert read_identity(program, DATA) == made
    assert read_identity(program, DATA + b";") is None
    assert read_identity(tmp_path / "other.src", DATA) is None
    require_compensable(program, DATA, MODEL)
    require_compensable(program, DATA + b";", NOMINAL)
    with pytest.raises(ModelMismatchError, match="the program was made with the calibrated KR"):
        require_compensable(program, DATA, NOMINAL)


def test_a_compensated_program_is_not_compensated_again(tmp_path: Path) -> None:
    program = tmp_path / "job.src"
    write_identity(
        program, DATA, ProgramIdentity(model=MODEL, compensated=True, made_from="cam.src")
    )
    with pytest.raises(ModelMismatchError, match="compensated already") as caught:
        require_compensable(program, DATA, MODEL)
    assert caught.value.hint == "compensate cam.src."


@pytest.mark.parametrize(("text", "message"), [
    ("{", "not the identity of a program"),
    ("[]", "not the identity of a program"),
    ('{"format": "robotrue-program-identity", "format_version": 2}', "this robotrue reads 1"),
])  # fmt: skip
def test_damaged_identities_are_named(tmp_path: Path, text: str, message: str) -> None:
    identity_path(tmp_path / "job.src").write_text(text)
    with pytest.raises(FormatError, match=message):
        read_identity(tmp_path / "job.src", DATA)
