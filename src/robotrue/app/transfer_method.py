"""``robotrue transfer --method deng2022``: stated domains and readings of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robotrue.app.context import Context
from robotrue.app.presentation import Block, Facts, Table
from robotrue.app.transfer_request import TransferRequest
from robotrue.calibration.deng2022.data_domains import domains_of_rows
from robotrue.calibration.deng2022.readings import (
    BOOSTING,
    LITERAL_BOOSTING,
    DengReadings,
    changed_readings,
    parse_readings,
)
from robotrue.calibration.settings import FitSettings
from robotrue.calibration.sources import TransferSource
from robotrue.calibration.training_summary import TrainingSummary
from robotrue.core.document_decoder import decode
from robotrue.core.regions import CylinderRegion, describe_region
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, ObservabilityError
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.planning.work_area import EXAMPLE, parse_region
from robotrue.robot.model import RobotModel
from robotrue.validation.guarded_transfer import METHOD, Contestants, deng2022_contestants
from robotrue.validation.source_check import check_rows


def paper_contestants(
    request: TransferRequest,
    robot: RobotModel,
    target: MeasurementSet | None,
    sources: Sequence[TransferSource],
    settings: FitSettings,
    context: Context,
) -> Contestants:
    """Returns the candidates of a transfer by the paper's method.

    Raises:
        ConfigurationError: Not one measured source, or domains and readings that cannot be.
        ObservabilityError: No target poses, or too few.
    """
    if len(sources) != 1 or sources[0].measurements is None:
        raise ConfigurationError(
            f"--method {METHOD} takes one source, a measurement file; {len(sources)} "
            f"source{'' if len(sources) == 1 else 's'} stated, "
            f"{sum(s.measurements is not None for s in sources)} of them measurements.",
            hint="--source NAME=FILE.csv,region",
        )
    if target is None:
        raise ObservabilityError(
            f"no target pose was measured; --method {METHOD} learns from them.",
            hint="three poses or more in every sub-space, after the options.",
        )
    known = sources[0].measurements
    for rows in (known, target):
        check_rows(robot, rows)
    domains = domains_of_rows(
        robot,
        known,
        target,
        source_region=parse_cylinder("--source-region", request.source_region),
        target_region=parse_cylinder("--target-region", request.target_region),
        sub_spaces=request.sub_spaces,
    )
    count = len(domains.sub_spaces)
    context.inform(f"source region: {describe_region(domains.source)}")
    context.inform(
        f"target region: {describe_region(domains.target)}, "
        f"{count} sub-space{'' if count == 1 else 's'}"
    )
    return deng2022_contestants(
        robot, target, sources[0], settings, domains, stated_readings(request)
    )


def stated_readings(request: TransferRequest) -> DengReadings:
    """Returns how the equations are to be read; ``--reading`` goes over the other options."""
    printed = {} if request.boosting == BOOSTING else LITERAL_BOOSTING
    return parse_readings(
        request.reading, attitude=request.attitude, rounds=request.rounds, **printed
    )


def parse_cylinder(option: str, text: str | None) -> CylinderRegion | None:
    """Returns the cylinder sector of an option; None where it was not stated.

    Raises:
        ConfigurationError: A box, or no region.
    """
    if text is None:
        return None
    region = parse_region(option, text)
    if not isinstance(region, CylinderRegion):
        raise ConfigurationError(
            f"{option} {text!r} is a box; the paper's regions turn about joint 1.",
            hint=f"{option} {EXAMPLE}",
        )
    return region


@dataclass(frozen=True, slots=True)
class _SubSpaceRow:
    """A sub-space of the paper's method, as the training summary keeps it."""

    angle_deg: float
    poses: int
    largest_pair_distance_m: float
    ridge: float


def sub_space_blocks(summary: TrainingSummary) -> Iterable[Block]:
    """Returns the sub-spaces and the readings of the paper's method; nothing for another one."""
    if summary.method != METHOD:
        return
    parts = decode(tuple[_SubSpaceRow, ...], summary["sub_spaces"], key="summary.sub_spaces")
    stated = decode(DengReadings, summary["readings"], key="summary.readings")
    inflation = decode(float, summary["inflation"], key="summary.inflation")
    yield Table(
        title="sub-spaces of the target",
        columns=("", "turned by deg", "target poses", "furthest pair mm", "lambda"),
        rows=tuple(
            (
                str(k + 1),
                f"{part.angle_deg:.4g}",
                str(part.poses),
                f"{part.largest_pair_distance_m / MM:.3f}",
                f"{part.ridge:.0e}",
            )
            for k, part in enumerate(parts)
        ),
    )
    other = [f"{name} {value}" for name, value in changed_readings(stated).items()]
    yield Facts(
        title="the paper's equations",
        rows=(
            ("readings", ", ".join(other) or "corrected"),
            ("boosting rounds", str(summary["rounds"])),
            ("variance widened by", f"{inflation:.2f}"),
        ),
    )
