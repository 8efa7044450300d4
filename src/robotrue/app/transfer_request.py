"""Request for a transfer: sources, new measurements, and the method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

from robotrue.app.request import (
    IN_JOBS,
    ON_COMMAND_LINE,
    Item,
    Option,
    Reference,
    Request,
)
from robotrue.app.request_fields import ForeignColumns, ModelOutput, SavedPage
from robotrue.calibration.deng2022.readings import (
    BOOSTING,
    AttitudeReading,
    Boosting,
    DengReadings,
)
from robotrue.errors import ConfigurationError

TransferMethod: TypeAlias = Literal["auto", "deng2022"]
AUTO: Final[TransferMethod] = "auto"
METHOD_OPTIONS: Final = (
    "sub_spaces", "source_region", "target_region", "attitude", "rounds", "boosting", "reading",
)  # fmt: skip
"""Fields of the paper's method alone."""
USUAL: Final = DengReadings()
"""Default readings of the paper's equations."""


def _source_item(relation: str) -> Item:
    """Field of a job for sources of one relation, with items and files."""
    return Item(
        noun="measurement",
        also=("model",),
        sent=True,
        shells=IN_JOBS,
        help=f"Measurements or models of {relation}.",
    )


class TransferRequest(Request):
    """Sources and new measurements: commands state sources, jobs items and files by relation."""

    cell: Annotated[
        Reference | None,
        Item(noun="cell", argument="CELL", needed_in=ON_COMMAND_LINE, help="cell.toml"),
    ] = None
    source: Annotated[
        tuple[str, ...],
        Option(
            names=("--source",),
            shells=ON_COMMAND_LINE,
            help="NAME=FILE[,region|campaign|unit]: measurements or a model; may be repeated.",
        ),
    ] = ()
    fleet: Annotated[
        tuple[Path, ...],
        Option(
            shells=ON_COMMAND_LINE,
            help="Model of another arm of the type, or a folder of such models; may be repeated.",
        ),
    ] = ()
    output: ModelOutput
    measurements: Annotated[
        tuple[Reference, ...],
        Item(noun="measurement", argument="[TARGET...]", sent=True, help="Target measurements."),
    ] = ()
    from_region: Annotated[
        tuple[Reference, ...], _source_item("another region, the same arm and time")
    ] = ()
    from_campaign: Annotated[tuple[Reference, ...], _source_item("another time, the same arm")] = ()
    from_unit: Annotated[tuple[Reference, ...], _source_item("another arm of the type")] = ()
    model: Annotated[
        Reference | None,
        Item(noun="model", shells=IN_JOBS, help="Model to update; it contains its cell."),
    ] = None
    mapping: ForeignColumns = None
    report: SavedPage = None
    curve: Annotated[
        bool, Option(help="Also compute the accuracy against the number of target poses.")
    ] = False
    method: Annotated[
        TransferMethod,
        Option(help=("auto (the best candidate) or deng2022 (the paper's Tr-GPR, also checked).")),
    ] = AUTO
    sub_spaces: Annotated[
        int | None,
        Option(
            least=1,
            help="deng2022: parts of the target as wide as the source; default: all that fit.",
        ),
    ] = None
    source_region: Annotated[
        str | None,
        Option(help="deng2022: angle_deg=A..B,radius_mm=..,height_mm=..; default: as measured."),
    ] = None
    target_region: Annotated[
        str | None, Option(help="deng2022: region of the target, like --source-region.")
    ] = None
    attitude: Annotated[
        AttitudeReading,
        Option(help="deng2022: turning (with the angle about joint 1) or fixed (in base)."),
    ] = USUAL.attitude
    rounds: Annotated[int, Option(least=1, help="deng2022: boosting rounds, at most.")] = (
        USUAL.rounds
    )
    boosting: Annotated[
        Boosting, Option(help="deng2022: corrected, or literal (eq. 19, 22 and 24 as printed).")
    ] = BOOSTING
    reading: Annotated[
        tuple[str, ...],
        Option(help="deng2022: NAME=VALUE, reading of an equation; may be repeated."),
    ] = ()


def refuse_method_options(request: TransferRequest) -> None:
    """Refuses options of the paper's method where it is not the one that was stated."""
    for name in METHOD_OPTIONS:
        if getattr(request, name) != TransferRequest.model_fields[name].get_default():
            option = f"--{name.replace('_', '-')}"
            raise ConfigurationError(
                f"{option} is an option of --method deng2022; the method is {request.method}.",
                hint=f"--method deng2022, or leave {option} out.",
            )
