"""Request for a transfer: sources, new measurements, and the method."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal, TypeAlias

from robotrue.app.request import IN_JOBS, ON_COMMAND_LINE, Item, Option, Reference, Request
from robotrue.app.request_fields import ForeignColumns, ModelOutput, SavedPage
from robotrue.calibration.deng2022.readings import BOOSTING, AttitudeReading, Boosting, DengReadings
from robotrue.errors import ConfigurationError

TransferMethod: TypeAlias = Literal["auto", "deng2022"]
AUTO: Final[TransferMethod] = "auto"
METHOD_OPTIONS: Final = (
    "sub_spaces", "source_region", "target_region", "attitude", "rounds", "boosting", "reading",
)  # fmt: skip
"""Fields of the paper's method alone."""
USUAL: Final = DengReadings()
"""Default readings of the paper's equations."""


SOURCES: Final = Item(noun="measurement", also=("model",), sent=True, shells=IN_JOBS)
"""Field of a job for sources of one relation, with items and files."""


class TransferRequest(Request):
    """Sources and new measurements: commands state sources, jobs items and files by relation."""

    cell: Annotated[
        Reference | None, Item(noun="cell", argument="CELL", needed_in=ON_COMMAND_LINE)
    ] = None
    """cell.toml"""
    source: Annotated[tuple[str, ...], Option(shells=ON_COMMAND_LINE)] = ()
    """NAME=FILE[,region|campaign|unit]: measurements or a model; may be repeated."""
    fleet: Annotated[tuple[Path, ...], Option(shells=ON_COMMAND_LINE)] = ()
    """Model of another arm of the type, or a folder of such models; may be repeated."""
    output: ModelOutput
    measurements: Annotated[
        tuple[Reference, ...], Item(noun="measurement", argument="[TARGET...]", sent=True)
    ] = ()
    """Target measurements."""
    from_region: Annotated[tuple[Reference, ...], SOURCES] = ()
    """Measurements or models of another region, the same arm and time."""
    from_campaign: Annotated[tuple[Reference, ...], SOURCES] = ()
    """Measurements or models of another time, the same arm."""
    from_unit: Annotated[tuple[Reference, ...], SOURCES] = ()
    """Measurements or models of another arm of the type."""
    model: Annotated[Reference | None, Item(noun="model", shells=IN_JOBS)] = None
    """Model to update; it contains its cell."""
    mapping: ForeignColumns = None
    report: SavedPage = None
    curve: bool = False
    """Also compute the accuracy against the number of target poses."""
    method: TransferMethod = AUTO
    """auto (the best candidate) or deng2022 (the paper's Tr-GPR, also checked)."""
    sub_spaces: Annotated[int | None, Option(least=1)] = None
    """deng2022: parts of the target as wide as the source; default: all that fit."""
    source_region: str | None = None
    """deng2022: angle_deg=A..B,radius_mm=..,height_mm=..; default: as measured."""
    target_region: str | None = None
    """deng2022: region of the target, like --source-region."""
    attitude: AttitudeReading = USUAL.attitude
    """deng2022: turning (with the angle about joint 1) or fixed (in base)."""
    rounds: Annotated[int, Option(least=1)] = USUAL.rounds
    """deng2022: boosting rounds, at most."""
    boosting: Boosting = BOOSTING
    """deng2022: corrected, or literal (eq. 19, 22 and 24 as printed)."""
    reading: tuple[str, ...] = ()
    """deng2022: NAME=VALUE, reading of an equation; may be repeated."""


def refuse_method_options(request: TransferRequest) -> None:
    """Refuses options of the paper's method where it is not the one that was stated."""
    for name in METHOD_OPTIONS:
        if getattr(request, name) != TransferRequest.model_fields[name].get_default():
            option = f"--{name.replace('_', '-')}"
            raise ConfigurationError(
                f"{option} is an option of --method deng2022; the method is {request.method}.",
                hint=f"--method deng2022, or leave {option} out.",
            )
