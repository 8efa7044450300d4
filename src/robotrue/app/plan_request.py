"""Request of a plan: which poses to choose, for which work, by which method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from robotrue.app.request import (
    ALL,
    NOT_IN_FORMS,
    InputFile,
    Item,
    Option,
    Output,
    Reference,
    Request,
    fields_of,
)
from robotrue.app.request_fields import CellFile, SavedPage, table_output
from robotrue.calibration.deng2022.readings import (
    TARGET_RULE,
    AttitudeReading,
    DengReadings,
    TargetRule,
)
from robotrue.errors import ConfigurationError
from robotrue.planning.plan_defaults import (
    CANDIDATES,
    CRITERION,
    HIERARCHICAL,
    INFORMATION,
    POSES,
    SEED,
    SOURCE_GRID,
    SUB_SPACES,
    TARGET_POSES,
    TOOL_ABC_DEG,
    TURNS_DEG,
    Criterion,
    PlanMethod,
)
from robotrue.program.measuring_defaults import TRIGGER_OUTPUT

OF_HIERARCHY: Final = (
    "source_region", "target_region", "sub_spaces", "grid", "turns_deg", "target_poses",
    "further", "target_rule", "attitude", "tool_abc_deg", "posture_deg",
)  # fmt: skip
OF_INFORMATION: Final = (
    "poses", "region", "program", "within", "model", "payloads", "approach", "criterion",
    "tolerance_um", "candidates", "krl", "trigger_output", "recorded",
)  # fmt: skip
"""Fields of one method alone."""


class PlanRequest(Request):
    """Cell, number of poses, and the region of work."""

    cell: CellFile
    output: Annotated[Path, table_output(saved_as="poses.csv")]
    """CSV of the poses to write."""
    poses: Annotated[int, Option(names=("--poses", "-n"), offered=(4, 500))] = POSES
    """Maximum number of poses."""
    region: str | None = None
    """Working region: angle_deg=A..B,radius_mm=..,height_mm=.."""
    program: Annotated[Reference | None, Item(noun="program", names=("--program-targets",))] = None
    """Alternative: program whose targets are the working region."""
    within: str | None = None
    """Allowed reflector positions while measuring, like --region."""
    model: Annotated[Reference | None, Item(noun="model")] = None
    """Calibration to improve."""
    payloads: Annotated[
        tuple[str, ...], Option(names=("--payload",), advanced=True, example="50,0,0,120")
    ] = ()
    """KG[,X,Y,Z]: an available load; may be repeated."""
    approach: Annotated[Literal["one-side", "as-it-comes"], Option(advanced=True)] = "one-side"
    """one-side or as-it-comes."""
    criterion: Annotated[Criterion, Option(advanced=True)] = CRITERION
    """I: accuracy in the working region. D: parameters."""
    tolerance_um: Annotated[float, Field(ge=0.0), Option(advanced=True, offered=(0, 1000))] = 0.0
    """Stop when the next pose would reduce the error by less than this."""
    recorded: Annotated[Path | None, InputFile(names=("--from",))] = None
    """Choose from these poses: CSV of joints, or a program with joint positions."""
    candidates: Annotated[int, Option(advanced=True, offered=(10, 50_000))] = CANDIDATES
    """Postures to choose from."""
    seed: Annotated[int, Option(advanced=True, offered=(0, 1_000_000))] = SEED
    """Seed of the candidates."""
    krl: Annotated[
        Path | None,
        Output(
            names=("--program",),
            what="a KRL program",
            suffixes=(".src",),
            only=True,
            saved_as="measure.src",
            shells=ALL,
            advanced=True,
        ),
    ] = None
    """Also write a KRL program that measures them (.src)."""
    trigger_output: Annotated[int, Option(advanced=True, offered=(1, 8192))] = TRIGGER_OUTPUT
    """Digital output that triggers the tracker."""
    report: SavedPage = None
    method: Annotated[PlanMethod, Option(shells=NOT_IN_FORMS)] = INFORMATION
    """information (most informative poses) or hierarchical (source grid and its images)."""
    source_region: Annotated[str | None, Option(shells=NOT_IN_FORMS)] = None
    """hierarchical: region sampled completely."""
    target_region: Annotated[str | None, Option(shells=NOT_IN_FORMS)] = None
    """hierarchical: region of the sub-spaces."""
    sub_spaces: Annotated[int, Option(shells=NOT_IN_FORMS, least=1)] = SUB_SPACES
    """hierarchical: parts of the target."""
    grid: Annotated[str, Option(shells=NOT_IN_FORMS)] = SOURCE_GRID
    """hierarchical: values of angle, radius, height."""
    turns_deg: Annotated[str, Option(shells=NOT_IN_FORMS)] = TURNS_DEG
    """hierarchical: LOW..HIGH/STEP or one number, for each of three angles."""
    target_poses: Annotated[int, Option(shells=NOT_IN_FORMS, least=1)] = TARGET_POSES
    """hierarchical: target poses in all sub-spaces."""
    further: Annotated[float, Field(ge=0.0), Option(shells=NOT_IN_FORMS)] = 0.0
    """hierarchical: fraction of additional poses in the furthest sub-space."""
    target_rule: Annotated[TargetRule, Option(shells=NOT_IN_FORMS)] = TARGET_RULE
    """hierarchical: random, boundary, corners or space-filling target poses."""
    attitude: Annotated[AttitudeReading, Option(shells=NOT_IN_FORMS)] = DengReadings().attitude
    """hierarchical: turning (with joint 1) or fixed."""
    tool_abc_deg: Annotated[str, Option(shells=NOT_IN_FORMS)] = TOOL_ABC_DEG
    """hierarchical: KUKA A,B,C of the measured point in base, at angle 0."""
    posture_deg: Annotated[str | None, Option(shells=NOT_IN_FORMS)] = None
    """hierarchical: axes as displayed, of the arm configuration."""


def refuse_other_method(request: PlanRequest) -> None:
    """Refuses options of the method that was not stated: they would do nothing.

    Raises:
        ConfigurationError: One of them is stated.
    """
    other = OF_HIERARCHY if request.method == INFORMATION else OF_INFORMATION
    for field in fields_of(PlanRequest):
        if field.name in other and getattr(request, field.name) != field.default:
            method = HIERARCHICAL if request.method == INFORMATION else INFORMATION
            raise ConfigurationError(
                f"{field.option} is an option of --method {method}; the method is "
                f"{request.method}.",
                hint=f"--method {method}, or leave {field.option} out.",
            )
