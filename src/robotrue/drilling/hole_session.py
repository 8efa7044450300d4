"""Drilling hole by hole: a clamp in, one move or a refusal out, what a reference found back in."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.columns import concat
from robotrue.core.provenance import MEASURED, Provenance, merge
from robotrue.core.units import DEG
from robotrue.drilling.adjust import HoleAdjustment, adjustment
from robotrue.drilling.campaign import Clamps
from robotrue.drilling.campaign_csv import ProductionRecord
from robotrue.drilling.clamp_watch import ClampSettings, ClampWatch, FootSample, Seen
from robotrue.drilling.correction import CorrectedReadings
from robotrue.drilling.foot_model import NormalModel, estimate_tilt
from robotrue.drilling.production import RecordUpdate, record_of, update_model
from robotrue.drilling.production_references import IMPOSSIBLE, find_cause
from robotrue.errors import ConfigurationError, ImplausibleDataError, RobotrueError

SIMULATED: Final = Provenance(simulated=True, instrument="drilling head")
KEPT: Final = 10_000
"""Holes kept for a reference that measures them later."""
FAR: Final = 0.5 * DEG
"""rad below which a reference is learned, however sure the model is: a zero may have shifted."""
FAR_KEPT: Final = 12
"""Refused references kept to find their common cause."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HoleAnswer:
    """Answer to the machine for one clamp.

    Attributes:
        hole: Its number or name.
        clamps: The clamp, one row; None where the foot did not come to rest.
        axes: (2,) rad, A and B at the clamp.
        adjustment: The one move; None where no move is commanded.
        refused: Why no move is commanded, with what to try; "" with a move.
        version: Of the model.
        simulated: Whether the machine marked its clamps as simulated, or the model was learned from
            such.
    """

    hole: str
    clamps: Clamps | None
    axes: Array
    adjustment: HoleAdjustment | None
    refused: str
    version: int
    simulated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedHole:
    """A hole that was moved for, until a reference measures what the move left.

    Attributes:
        clamps: The clamp, one row.
        tilt: (2,) rad, by which the spindle moved, as the model in force at that hole gave it.
        version: Of that model.
    """

    clamps: Clamps
    tilt: Array
    version: int


class HoleSession:
    """A model in use.

    Args:
        model: Learned from a campaign, perhaps frozen.
        settings: When the foot counts as clamped and at rest.
        approach: How this cell brings its foot down, as the campaign names it.
        reference: rad, deviation of the outside reference in each of a and b.
        waiting: Holes moved for before, for references that come late.
        count: Clamps answered before.
    """

    def __init__(
        self,
        model: NormalModel,
        *,
        settings: ClampSettings,
        reference: float,
        approach: str = "",
        waiting: Mapping[str, MovedHole] | None = None,
        count: int = 0,
    ) -> None:
        if not reference > 0.0:
            raise ConfigurationError(
                f"deviation of the reference is {reference:g} rad, expected above 0."
            )
        self.model = model
        self._watch = ClampWatch(settings, approach=approach)
        self._reference = reference
        self._waiting = OrderedDict(waiting or {})
        self._count = count
        self._machine = MEASURED
        self._far: OrderedDict[str, tuple[Clamps, Array]] = OrderedDict()

    @property
    def provenance(self) -> Provenance:
        """Provenance of the model merged with that of the machine."""
        return merge([self.model.provenance, self._machine])

    @property
    def reference_sigma(self) -> float:
        """Returns the deviation of the outside reference in each of a and b, rad."""
        return self._reference

    def mark_simulated(self) -> None:
        """Records that the machine is marked as simulated; it stays so."""
        self._machine = SIMULATED

    def push(self, sample: FootSample, *, hole: str = "") -> HoleAnswer | None:
        """Returns the answer to a clamp with the sample that completes it; None otherwise.

        Args:
            sample: Of the foot.
            hole: Its name; holes are counted without.

        Raises:
            ShapeError: Not one reading per sensor.
        """
        event = self._watch.push(sample)
        if event.seen is Seen.BEGUN:
            self._count += 1
        if event.seen not in (Seen.TAKEN, Seen.RESTLESS):
            return None
        name = hole or str(self._count)
        found, refused = None, ""
        if event.clamps is None:
            refused = f"the foot does not come to rest: {event.said}. Clamp again."
        else:
            found, refused = self._adjust(event.clamps, event.axes)
            if found is not None:
                moved = MovedHole(clamps=event.clamps, tilt=found.tilt, version=self.model.version)
                self._keep(name, moved)
        return HoleAnswer(
            hole=name,
            clamps=event.clamps,
            axes=event.axes,
            adjustment=found,
            refused=refused,
            version=self.model.version,
            simulated=self.provenance.simulated,
        )

    def broken(self) -> None:
        """Marks a sample as bad or missing: the time at rest restarts."""
        self._watch.broken()

    def forget(self, hole: str) -> None:
        """Removes a hole from those moved for: the move was not commanded."""
        self._waiting.pop(hole, None)

    def take_reference(self, hole: str, left: Array, truth: str) -> RecordUpdate:
        """Updates the model with an outside reference at a hole after its move.

        Args:
            hole: As answered.
            left: (2,) rad, true normal less spindle axis, as (a, b).
            truth: What measured it.

        Raises:
            ConfigurationError: A hole that was not moved for here, or no outside reference.
            ImplausibleDataError: So far off that it is no residual of this move; not learned.
        """
        drilled = self._waiting.get(hole)
        if drilled is None:
            raise ConfigurationError(
                f"a reference for hole {hole!r}, for which this session has no move.",
                hint="the name of a hole that was answered with a move; each reference once.",
            )
        found = estimate_tilt(self.model, drilled.clamps)
        self._refuse_far(hole, drilled, left, found)
        record = record_of(hole, found, left, truth, self._machine, moved=drilled.tilt)
        step = update_model(self.model, found, record, reference=self._reference)
        self.model = step.model
        del self._waiting[hole]
        return step

    def _refuse_far(
        self, hole: str, drilled: MovedHole, left: Array, found: CorrectedReadings
    ) -> None:
        """Refuses a reference far beyond model and reference; names the cause of several."""
        expected = float(np.sqrt(np.trace(found.covariance[0]) / 2.0 + self._reference**2))
        off = float(np.hypot(*left))
        if off <= max(IMPOSSIBLE * expected, FAR):
            return
        self._far[hole] = (drilled.clamps, left)
        while len(self._far) > FAR_KEPT:
            self._far.popitem(last=False)
        said = (
            f"the reference of hole {hole} is {off / DEG:.3f} deg, {expected / DEG:.4f} deg are "
            "expected of model and reference: it is not used"
        )
        hint = "left_a_deg, left_b_deg in degrees, true normal less spindle axis, after the move."
        clamps, lefts = zip(*self._far.values(), strict=True)
        record = ProductionRecord(
            clamps=concat(clamps),
            left=np.array(lefts),
            hole=tuple(self._far),
            source="",
            provenance=self._machine,
        )
        if (cause := find_cause(self.model, record)) is not None:
            said += f"; {cause.rms / DEG:.4f} deg over {len(self._far)} holes if {cause.said}"
            hint = cause.hint
        raise ImplausibleDataError(f"{said}.", hint=hint)

    def _adjust(self, clamps: Clamps, axes: Array) -> tuple[HoleAdjustment | None, str]:
        try:
            return adjustment(self.model, clamps, axes), ""
        except RobotrueError as cause:
            return None, cause.message + (f" ({cause.hint})" if cause.hint else "")

    def _keep(self, hole: str, drilled: MovedHole) -> None:
        self._waiting[hole] = drilled
        self._waiting.move_to_end(hole)
        if len(self._waiting) > KEPT:
            self._waiting.popitem(last=False)
