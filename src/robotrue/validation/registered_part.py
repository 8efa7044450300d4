"""A registered part: its frames, the model they belong to, and whether to cut."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

import numpy as np
from scipy.stats import chi2

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.cell.part import PartFrame, PartTable
from robotrue.cell.registration.fit import Registration, point_covariance
from robotrue.core.arrays import Array
from robotrue.core.columns import Column, Columns
from robotrue.core.graduated import GAUSS_POINT
from robotrue.core.model_identity import ModelIdentity
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.units import MM, UM

Route = Literal["frame", "joint"]
"""``frame``: the arm's model as it is; ``joint``: arm, tool and frames in one estimate."""
FEW_BEYOND: Final = 0.15
"""Share of touches just beyond the bound of good ones that chance may put there."""
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
        registration: Frame, covariance, residuals, touches not believed.
        points: (n, 3) m in part, the nominal points of the touches.
        machined: (n, 3, 3) m^2 in part, covariance of a machined point at each touch and in its
            posture: frame and arm together; without joints the frame's share alone.
        with_arm: Whether ``machined`` holds the arm's share.
        reasons: Why not to cut, one sentence each.
        doubts: What the touches cannot tell, one sentence each.
    """

    name: str
    registration: Registration
    points: Annotated[Array, Column("n 3", unit="m")]
    machined: Annotated[Array, Column("n 3 3", unit="m^2")]
    with_arm: bool = True
    reasons: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def _known_sizes(self) -> dict[Any, int]:
        return {"n": len(self.registration.names)}

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
    """What touching told.

    Attributes:
        route: How.
        frames: One per part or side, in the order of the file.
        identity: The model the frames belong to: only it may run programs in them.
        touched_with: The model that was given; another one where the joint estimate moved the arm.
        refined: The arm as the joint estimate has it; None where it stayed as it was.
        moved: m, rms, by which the refined arm puts the tip elsewhere at the touches; 0 without.
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
        tolerance: m that machined points must keep with 95 %; None: not judged.
        reasons: Against cutting, found elsewhere.
        doubts: Found elsewhere.
    """
    T = registration.T_base_part
    with_arm = machined is not None
    if machined is None:
        machined = T[:3, :3].T @ point_covariance(registration, points) @ T[:3, :3]
    found = FoundFrame(name=name, registration=registration, points=points, machined=machined)
    against, open_ = list(reasons), list(doubts)
    freedom, misfit = registration.degrees_of_freedom, registration.misfit
    allowed = float(np.sqrt(chi2.ppf(MISFIT, max(freedom, 1)) / max(freedom, 1)))
    if freedom < 1:
        open_.append(
            "No touch is left over that could contradict the frame: touch one or two more."
        )
    elif misfit > allowed:
        against.append(
            f"The touches scatter {misfit:.1f} times what touch and arm together should "
            f"({registration.sigma / MM:.3f} mm per axis; up to {allowed:.1f} times is allowed): "
            f"{_worst(registration)}."
        )
    near = _just_beyond(registration)
    if len(near) > max(2, FEW_BEYOND * len(registration.names)):
        against.append(
            f"{len(near)} of {len(registration.names)} touches lie just beyond what good ones may "
            f"({GAUSS_POINT * registration.sigma / MM:.3f} mm): {_list_names(registration, near)}. "
            "Touch or arm are worth less than stated."
        )
    elif registration.rms < TOO_GOOD * registration.sigma:
        open_.append(
            f"The touches fit to {registration.rms / UM:.2g} um, nobody touches that well: are "
            "planned or computed points in the place of touched ones?"
        )
    if registration.outliers:
        open_.append(
            f"Not believed: {_list_names(registration, registration.outliers)}; touch again."
        )
    else:
        stray = _stray(registration)
        if stray:
            open_.append(
                f"Far off beside the others: {_list_names(registration, stray)}; touch again."
            )
    if tolerance is not None and found.region.max() > tolerance:
        worst = int(np.argmax(found.region))
        against.append(
            f"A point machined at {registration.names[worst]} is known to "
            f"{found.region[worst] / MM:.3f} mm (95 %), the tolerance is {tolerance / MM:.3f} mm."
        )
    return FoundFrame(
        name=name,
        registration=registration,
        points=points,
        machined=machined,
        with_arm=with_arm,
        reasons=tuple(against),
        doubts=tuple(open_),
    )


def _just_beyond(registration: Registration) -> tuple[str, ...]:
    """Touches not believed that are not far off either: a bound through the good ones."""
    far = dict(zip(registration.names, registration.distances, strict=True))
    bound = 3.0 * GAUSS_POINT * registration.sigma
    return tuple(name for name in registration.outliers if far[name] < bound)


def _stray(registration: Registration) -> tuple[str, ...]:
    """Touches within the noise stated that stand out among the others: the arm's share is wide."""
    distance = registration.distances
    if len(distance) < 6:
        return ()
    usual = float(np.median(distance)) / 1.5382  # median of a chi with 3 degrees of freedom
    return tuple(
        name
        for name, far in zip(registration.names, distance, strict=True)
        if far > 6.0 * max(usual, 0.02 * MM)
    )


def _list_names(registration: Registration, names: tuple[str, ...]) -> str:
    far = dict(zip(registration.names, registration.distances, strict=True))
    return ", ".join(f"{name} ({far[name] / MM:.3f} mm)" for name in names)


def _worst(registration: Registration) -> str:
    believed = [
        (far, name)
        for far, name, good in zip(
            registration.distances, registration.names, registration.believed, strict=True
        )
        if good
    ]
    return "worst " + ", ".join(
        f"{name} ({far / MM:.3f} mm)" for far, name in sorted(believed, reverse=True)[:3]
    )
