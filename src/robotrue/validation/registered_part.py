"""A registered part: its frames, the model they belong to, and whether to cut."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal

import numpy as np
from scipy.stats import chi2

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.cell.part import PartFrame, PartTable
from robotrue.cell.registration.fit import Registration, point_covariance
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.robust import GAUSS_POINT
from robotrue.core.units import MM, UM

Route = Literal["frame", "joint"]
"""``frame``: the arm's model as it is; ``joint``: arm, tool and frames in one estimate."""
FEW_BEYOND: Final = 0.15
"""Share of touches just beyond the bound of good ones that chance explains."""
MISFIT: Final = 0.999
"""Probability that the residuals of good touches stay below the bound of the verdict."""
TOO_GOOD: Final = 1e-3
"""Residuals below this share of the noise are not those of touches."""
REGION: Final = float(np.sqrt(chi2.ppf(0.95, 3)))
"""A 3-D error is within this many standard deviations of its worst direction, 95 % or more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundFrame(Columns):
    """One part or side.

    Attributes:
        name: Of the part or side.
        registration: Frame, covariance, residuals, rejected touches.
        points: (n, 3) m in part, the nominal points of the touches.
        machined: (n, 3, 3) m^2 in part, covariance of a machined point at each touch and in its
            posture: frame and arm together; without joints the frame's share alone.
        with_arm: Whether ``machined`` holds the arm's share.
        reasons: Why not to cut, one sentence each.
        doubts: What the touches do not determine, one sentence each.
    """

    name: str
    registration: Registration
    points: Annotated[Array, Column("n 3", unit="m")]
    machined: Annotated[Array, Column("n 3 3", unit="m^2")]
    with_arm: bool = True
    reasons: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(n=len(self.registration.names))

    @property
    def verdict(self) -> str:
        """``GO``, or ``NO-GO`` if there is a reason not to cut."""
        return "NO-GO" if self.reasons else "GO"

    @property
    def region(self) -> Array:
        """Distance that a point machined at each touch keeps 95 times in 100, (n,) m."""
        return np.asarray(REGION * np.sqrt(np.linalg.eigvalsh(self.machined)[:, -1]))

    def part_frame(self) -> PartFrame:
        """Returns what a cell file keeps of it."""
        found = self.registration
        return PartFrame(
            name=self.name,
            T_base_part=found.T_base_part,
            covariance=found.covariance,
            touches=len(found.names),
            outliers=found.outliers,
            rms=found.rms,
            verdict=self.verdict,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RegisteredPart:
    """Result of probing a part.

    Attributes:
        route: How.
        frames: One per part or side, in the order of the file.
        identity: The model the frames belong to: only it may run programs in them.
        touched_with: The model that was given; another one where the joint estimate moved the arm.
        refined: The arm as the joint estimate has it; None where it stayed as it was.
        moved: m, rms shift of the refined arm's tip at the touches; 0 without.
        doubts: About all frames.
        provenance: Of the touches and of the arm's model.
    """

    route: Route
    frames: tuple[FoundFrame, ...]
    identity: ModelIdentity
    touched_with: ModelIdentity
    refined: CalibratedModel | None = None
    moved: float = 0.0
    doubts: tuple[str, ...] = ()
    provenance: Provenance = MEASURED

    @property
    def verdict(self) -> str:
        """``GO`` if every frame is; else ``NO-GO``."""
        return "GO" if all(frame.verdict == "GO" for frame in self.frames) else "NO-GO"

    def table(
        self, *, model_file: str = "", points_file: str = "", points_sha256: str = ""
    ) -> PartTable:
        """Returns what a cell file keeps; arguments as its attributes."""
        return PartTable(
            frames=tuple(frame.part_frame() for frame in self.frames),
            identity=self.identity,
            method=self.route,
            model_file=model_file,
            points_file=points_file,
            points_sha256=points_sha256,
            provenance=self.provenance,
        )


def check_frame(
    name: str,
    registration: Registration,
    points: Array,
    machined: Array | None,
    *,
    tolerance: float | None,
    reasons: tuple[str, ...] = (),
    doubts: tuple[str, ...] = (),
) -> FoundFrame:
    """Returns a frame with its verdict.

    Args:
        name: Of the part.
        registration: The frame.
        points: (n, 3) m in part.
        machined: (n, 3, 3) m^2 in part; None takes the frame's share alone.
        tolerance: m that machined points must meet with 95 %; None: not checked.
        reasons: Against cutting, found elsewhere.
        doubts: Found elsewhere.
    """
    with_arm = machined is not None
    if machined is None:
        R = registration.T_base_part[:3, :3]
        machined = R.T @ point_covariance(registration, points) @ R
    frame = FoundFrame(
        name=name, registration=registration, points=points, machined=machined, with_arm=with_arm
    )
    return replace(
        frame,
        reasons=(*reasons, *_find_reasons(frame, tolerance)),
        doubts=(*doubts, *_find_doubts(frame)),
    )


def _find_reasons(frame: FoundFrame, tolerance: float | None) -> Iterator[str]:
    """Why not to cut: touches that contradict the frame, and too wide a region."""
    fit = frame.registration
    freedom, misfit = max(fit.degrees_of_freedom, 1), fit.misfit
    allowed = float(np.sqrt(chi2.ppf(MISFIT, freedom) / freedom))
    if misfit > allowed:
        yield (
            f"The scatter of the touches is {misfit:.1f} times that expected of touch and arm "
            f"together ({fit.sigma / MM:.3f} mm per axis; up to {allowed:.1f} times is allowed): "
            f"worst {_list_distances(fit, _believed_by_distance(fit)[:3])}."
        )
    if near := _many_just_beyond(fit):
        yield (
            f"{len(near)} of {len(fit.names)} touches lie just beyond the limit for good ones "
            f"({GAUSS_POINT * fit.sigma / MM:.3f} mm): {_list_distances(fit, near)}. Touch or arm "
            "are less accurate than stated."
        )
    worst = int(np.argmax(frame.region))
    if tolerance is not None and frame.region[worst] > tolerance:
        yield (
            f"A point machined at {fit.names[worst]} is known to "
            f"{frame.region[worst] / MM:.3f} mm (95 %), the tolerance is {tolerance / MM:.3f} mm."
        )


def _find_doubts(frame: FoundFrame) -> Iterator[str]:
    """Yields warnings about what the touches cannot determine."""
    fit = frame.registration
    if fit.degrees_of_freedom < 1:
        yield "The frame has no redundant touch to reveal an error: probe one or two more points."
    spare = fit.degrees_of_freedom > 0
    if spare and not _many_just_beyond(fit) and fit.rms < TOO_GOOD * fit.sigma:
        yield (
            f"The touches fit to {fit.rms / UM:.2g} um, better than touching allows: are they "
            "planned or computed points instead of touched ones?"
        )
    if fit.outliers:
        yield f"Not used: {_list_distances(fit, fit.outliers)}; probe again."
    elif stray := _stray(fit):
        yield f"Far off compared with the others: {_list_distances(fit, stray)}; probe again."


def _many_just_beyond(fit: Registration) -> tuple[str, ...]:
    """Warns of many rejected touches close to the bound: it cuts through the good ones."""
    far = _distances(fit)
    near = tuple(k for k in fit.outliers if far[k] < 3.0 * GAUSS_POINT * fit.sigma)
    return near if len(near) > max(2, FEW_BEYOND * len(fit.names)) else ()


def _stray(fit: Registration) -> tuple[str, ...]:
    """Warns of touches within the stated noise that are far off the others."""
    if len(fit.names) < 6:
        return ()
    usual = float(np.median(fit.distances)) / 1.5382  # median of a chi with 3 degrees of freedom
    return tuple(k for k, far in _distances(fit).items() if far > 6.0 * max(usual, 0.02 * MM))


def _believed_by_distance(fit: Registration) -> list[str]:
    believed = [(far, k) for k, far in _distances(fit).items() if k not in fit.outliers]
    return [k for _, k in sorted(believed, reverse=True)]


def _distances(fit: Registration) -> dict[str, float]:
    return dict(zip(fit.names, fit.distances.tolist(), strict=True))


def _list_distances(fit: Registration, names: Sequence[str]) -> str:
    far = _distances(fit)
    return ", ".join(f"{name} ({far[name] / MM:.3f} mm)" for name in names)
