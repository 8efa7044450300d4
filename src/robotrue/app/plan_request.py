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
    output: Annotated[Path, table_output(saved_as="poses.csv", help="CSV of the poses to write.")]
    poses: Annotated[
        int, Option(names=("--poses", "-n"), offered=(4, 500), help="Maximum number of poses.")
    ] = POSES
    region: Annotated[
        str | None,
        Option(help="Working region: angle_deg=A..B,radius_mm=..,height_mm=.."),
    ] = None
    program: Annotated[
        Reference | None,
        Item(
            noun="program",
            names=("--program-targets",),
            help="Alternative: program whose targets are the working region.",
        ),
    ] = None
    within: Annotated[
        str | None, Option(help="Allowed reflector positions while measuring, like --region.")
    ] = None
    model: Annotated[
        Reference | None,
        Item(noun="model", help="Calibration to improve."),
    ] = None
    payloads: Annotated[
        tuple[str, ...],
        Option(
            names=("--payload",),
            advanced=True,
            example="50,0,0,120",
            help="KG[,X,Y,Z]: an available load; may be repeated.",
        ),
    ] = ()
    approach: Annotated[
        Literal["one-side", "as-it-comes"],
        Option(advanced=True, help="one-side or as-it-comes."),
    ] = "one-side"
    criterion: Annotated[
        Criterion,
        Option(advanced=True, help="I: accuracy in the working region. D: parameters."),
    ] = CRITERION
    tolerance_um: Annotated[
        float,
        Field(ge=0.0),
        Option(
            advanced=True,
            offered=(0, 1000),
            help="Stop when the next pose would reduce the error by less than this.",
        ),
    ] = 0.0
    recorded: Annotated[
        Path | None,
        InputFile(
            names=("--from",),
            help="Choose from these poses: CSV of joints, or a program with joint positions.",
        ),
    ] = None
    candidates: Annotated[
        int, Option(advanced=True, offered=(10, 50_000), help="Postures to choose from.")
    ] = CANDIDATES
    seed: Annotated[
        int, Option(advanced=True, offered=(0, 1_000_000), help="Seed of the candidates.")
    ] = SEED
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
            help="Also write a KRL program that measures them (.src).",
        ),
    ] = None
    trigger_output: Annotated[
        int,
        Option(advanced=True, offered=(1, 8192), help="Digital output that triggers the tracker."),
    ] = TRIGGER_OUTPUT
    report: SavedPage = None
    method: Annotated[
        PlanMethod,
        Option(
            shells=NOT_IN_FORMS,
            help=(
                "information (most informative poses) or hierarchical (source grid and its images)."
            ),
        ),
    ] = INFORMATION
    source_region: Annotated[
        str | None,
        Option(shells=NOT_IN_FORMS, help="hierarchical: region sampled completely."),
    ] = None
    target_region: Annotated[
        str | None, Option(shells=NOT_IN_FORMS, help="hierarchical: region of the sub-spaces.")
    ] = None
    sub_spaces: Annotated[
        int, Option(shells=NOT_IN_FORMS, least=1, help="hierarchical: parts of the target.")
    ] = SUB_SPACES
    grid: Annotated[
        str, Option(shells=NOT_IN_FORMS, help="hierarchical: values of angle, radius, height.")
    ] = SOURCE_GRID
    turns_deg: Annotated[
        str,
        Option(
            shells=NOT_IN_FORMS,
            help="hierarchical: LOW..HIGH/STEP or one number, for each of three angles.",
        ),
    ] = TURNS_DEG
    target_poses: Annotated[
        int,
        Option(shells=NOT_IN_FORMS, least=1, help="hierarchical: target poses in all sub-spaces."),
    ] = TARGET_POSES
    further: Annotated[
        float,
        Field(ge=0.0),
        Option(
            shells=NOT_IN_FORMS,
            help="hierarchical: fraction of additional poses in the furthest sub-space.",
        ),
    ] = 0.0
    target_rule: Annotated[
        TargetRule,
        Option(
            shells=NOT_IN_FORMS,
            help="hierarchical: random, boundary, corners or space-filling target poses.",
        ),
    ] = TARGET_RULE
    attitude: Annotated[
        AttitudeReading,
        Option(shells=NOT_IN_FORMS, help="hierarchical: turning (with joint 1) or fixed."),
    ] = DengReadings().attitude
    tool_abc_deg: Annotated[
        str,
        Option(
            shells=NOT_IN_FORMS,
            help="hierarchical: KUKA A,B,C of the measured point in base, at angle 0.",
        ),
    ] = TOOL_ABC_DEG
    posture_deg: Annotated[
        str | None,
        Option(
            shells=NOT_IN_FORMS, help="hierarchical: axes as displayed, of the arm configuration."
        ),
    ] = None


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
