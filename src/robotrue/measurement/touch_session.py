"""A session at the part: its features, the readings, and the state of every reading.

Numbers are as typed, in mm and deg, joints in the model's sense; a session written out as a file of
touched points, with the axes that the controller displays, reads back the same. Nothing is deleted:
an undone reading stays and is marked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.csv_text import axis_names, csv_text
from robotrue.core.document_decoder import decode
from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError

State: TypeAlias = Literal["kept", "held", "dropped", "replaced", "skipped", "undone"]
"""``held``: not as expected, the operator decides. ``dropped``: to be touched again. ``replaced``:
its feature was touched again since."""
Reads: TypeAlias = Literal["joints", "position"]
COUNTED: Final = ("kept", "held", "skipped")


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchFeature:
    """A place of the part that can be touched.

    Attributes:
        name: Of the feature.
        part: Number of its part.
        point_mm: In the part.
        normal: Outward, of a surface; None: a full point.
        postures_deg: Joints it can be touched with, as planned, in the model's sense; the first is
            also the one it is taken to be machined in. Empty: out of reach as far as is known.
    """

    name: str
    part: int
    point_mm: tuple[float, float, float]
    normal: tuple[float, float, float] | None = None
    postures_deg: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchReading:
    """Entered reading of a feature.

    Attributes:
        feature: Its number.
        state: What became of it.
        values: Joints in deg, in the model's sense, or x, y, z in mm; empty where skipped.
        text: As it was typed or pasted.
        at: When, ISO 8601.
        sigmas: Deviation from the expectation, in its standard deviations.
        off_mm: The same as a length.
        radius_mm: After it, what a point machined at the worst feature is known to, 95 %.
        suspicions: What would explain it, as JSON values.
    """

    feature: int
    state: State
    values: tuple[float, ...] = ()
    text: str = ""
    at: str = ""
    sigmas: float | None = None
    off_mm: float | None = None
    radius_mm: float | None = None
    suspicions: tuple[Mapping[str, object], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbingSession:
    """All of it.

    Attributes:
        features: That can be touched.
        parts: Names of the parts.
        rough: Rough frame of each part, T_base_part, (4, 4) nested, m.
        reads: What a reading is.
        settings: Of the registration and of reading, JSON values in mm and deg.
        readings: In the order they came.
        simulated: Whether the readings come from a simulation, by the marks of its files.
    """

    features: tuple[TouchFeature, ...]
    parts: tuple[str, ...]
    rough: tuple[tuple[tuple[float, ...], ...], ...]
    reads: Reads
    settings: Mapping[str, object]
    readings: tuple[TouchReading, ...] = ()
    simulated: bool = False

    @property
    def held(self) -> TouchReading | None:
        """The reading that waits for a decision, if one does."""
        return next((each for each in self.readings if each.state == "held"), None)

    @property
    def kept(self) -> tuple[TouchReading, ...]:
        """Readings that count."""
        return tuple(each for each in self.readings if each.state == "kept")

    @property
    def open(self) -> tuple[int, ...]:
        """Features without a reading that counts, and not skipped."""
        done = {each.feature for each in self.readings if each.state in COUNTED}
        return tuple(k for k in range(len(self.features)) if k not in done)

    def with_reading(self, reading: TouchReading) -> ProbingSession:
        """Returns the session with one more reading.

        Raises:
            ConfigurationError: Another one waits for a decision, or there is no such feature.
        """
        if self.held is not None:
            raise ConfigurationError(
                f"the reading of {self.features[self.held.feature].name!r} waits for a decision.",
                hint="accept it, probe again, or skip the point.",
            )
        if not 0 <= reading.feature < len(self.features):
            raise ConfigurationError(
                f"feature {reading.feature + 1} of {len(self.features)}: there is none."
            )
        found = replace(self, readings=(*self.readings, reading))
        return found._count_last_kept() if reading.state == "kept" else found

    def decide(self, state: Literal["kept", "dropped", "skipped"]) -> ProbingSession:
        """Returns the session with the pending reading accepted, dropped, or its point skipped.

        Raises:
            ConfigurationError: None waits.
        """
        found = self._change_last(("held",), state)
        return found._count_last_kept() if state == "kept" else found

    def undo(self) -> ProbingSession:
        """Returns the session as if what was entered last had not been; it stays on record.

        Raises:
            ConfigurationError: Nothing was entered.
        """
        last = next((each for each in reversed(self.readings) if each.state in COUNTED), None)
        found = self._change_last(COUNTED, "undone")
        if last is not None and last.state == "kept":  # the touch it had replaced is back
            back = [
                k
                for k, each in enumerate(found.readings)
                if each.feature == last.feature and each.state == "replaced"
            ]
            return found._with_state(back[-1], "kept") if back else found
        return found

    def _change_last(self, among: Sequence[str], state: State) -> ProbingSession:
        for k in range(len(self.readings) - 1, -1, -1):
            if self.readings[k].state in among:
                return self._with_state(k, state)
        raise ConfigurationError(
            "no reading waits for a decision."
            if among == ("held",)
            else "nothing was entered yet: nothing to undo."
        )

    def _with_state(self, number: int, state: State) -> ProbingSession:
        changed = replace(self.readings[number], state=state)
        readings = (*self.readings[:number], changed, *self.readings[number + 1 :])
        return replace(self, readings=readings)

    def _count_last_kept(self) -> ProbingSession:
        """Counts one reading of each feature: the last accepted one."""
        last = {each.feature: k for k, each in enumerate(self.readings) if each.state == "kept"}
        found = self
        for k, each in enumerate(self.readings):
            if each.state == "kept" and last[each.feature] != k:
                found = found._with_state(k, "replaced")
        return found


def session_document(session: ProbingSession) -> dict[str, object]:
    """Returns a session as JSON values."""
    return asdict(session)


def session_of(document: object) -> ProbingSession:
    """Returns a session from its JSON values; unknown keys are ignored.

    Raises:
        ConfigurationError: They are those of something else.
    """
    try:
        return decode(ProbingSession, document, error=ConfigurationError)
    except ConfigurationError as cause:
        raise ConfigurationError(f"no session of touches: {cause.message}") from cause


def session_csv(
    session: ProbingSession,
    readings: Sequence[TouchReading],
    to_controller: Callable[[Array], Array],
) -> bytes:
    """Returns readings as the file of touched points that ``robotrue register`` reads.

    Args:
        session: Whose features they are of.
        readings: With values; every number is written with all its digits.
        to_controller: Converts joints (n, dof) rad to the axes that the controller displays, which
            the file states.
    """
    axes, values = ["x_mm", "y_mm", "z_mm"], [each.values for each in readings]
    if session.reads == "joints" and values:
        shown = np.round(to_controller(np.array(values) * DEG) / DEG, 9) + 0.0
        axes, values = list(axis_names(shown.shape[1])), shown.tolist()
    with_normals = any(session.features[each.feature].normal for each in readings)
    header = ["name", "px_mm", "py_mm", "pz_mm", *axes]
    header += ["nx", "ny", "nz"] if with_normals else []
    header += ["part"] if len(session.parts) > 1 else []
    rows = [header]
    for each, numbers in zip(readings, values, strict=True):
        feature = session.features[each.feature]
        row = [feature.name, *map(repr, feature.point_mm), *map(repr, numbers)]
        if with_normals:
            row += [""] * 3 if feature.normal is None else [repr(v) for v in feature.normal]
        if len(session.parts) > 1:
            row.append(session.parts[feature.part])
        rows.append(row)
    origin = Provenance(simulated=session.simulated, instrument="robot at the part")
    return (mark_line(origin) + csv_text(rows)).encode()
