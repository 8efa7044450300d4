"""Training summary of a model: JSON values in an archive, decoded only here."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.document_decoder import decode

T = TypeVar("T")
U = TypeVar("U")


@dataclass(frozen=True, slots=True, kw_only=True)
class Unseen:
    """A combination of parameters that the data do not determine.

    Attributes:
        name: Of the combination.
        cure: Measurement that would determine it; empty if unknown.
        harmless: No position of the measured point depends on it.
        terms: Parameter and coefficient, SI; empty where harmless or not recorded.
    """

    name: str
    cure: str = ""
    harmless: bool = False
    terms: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedParameter:
    """A robot parameter as estimated.

    Attributes:
        value: SI.
        sd: SI.
        kind: ``seen``, ``weakly seen``, ``prior only`` or ``fixed``.
    """

    value: float
    sd: float
    kind: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingStep:
    """A step of the lineage of a model.

    Attributes:
        step: ``fit``, ``update``, ``transfer``, ...
        rows: Measured poses it added.
        data_sha256: Of their joints and positions.
        sources: Files they were read from.
    """

    step: str = ""
    rows: int = 0
    data_sha256: str = ""
    sources: tuple[str, ...] = ()


def read_step(stated: Mapping[str, object]) -> TrainingStep:
    """Returns an entry of :attr:`TrainingSummary.lineage`.

    Raises:
        ArchiveError: A value of another type.
    """
    return decode(TrainingStep, stated, key="summary.lineage")


def describe_parameters(
    names: Iterable[str], values: Array, sd: Array, kinds: Iterable[str]
) -> dict[str, dict[str, object]]:
    """Returns the JSON values of parameters; kinds as in :class:`EstimatedParameter`."""
    return {
        name: {"value": value, "sd": spread, "class": kind}
        for name, value, spread, kind in zip(
            names, values.tolist(), sd.tolist(), kinds, strict=True
        )
    }


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSummary(Mapping[str, object]):
    """The summary of a model. As a mapping it is its JSON document.

    Properties of what a model never recorded are empty or None.

    Attributes:
        document: JSON values; lengths are SI.
    """

    document: Mapping[str, object] = field(default_factory=dict)

    def __getitem__(self, key: str) -> object:
        """Returns a JSON value."""
        return self.document[key]

    def __iter__(self) -> Iterator[str]:
        """Yields the keys of the document."""
        return iter(self.document)

    def __len__(self) -> int:
        """Number of keys."""
        return len(self.document)

    @property
    def method(self) -> str:
        """Calibration method."""
        return str(self.document.get("method", ""))

    @property
    def rows(self) -> int:
        """Number of measured poses."""
        return self._read("rows", int, 0)

    @property
    def target_rows(self) -> int:
        """Of those, the number that a transfer took from the target itself."""
        return self._read("target_rows", int, 0)

    @property
    def screened_rows(self) -> tuple[int, ...]:
        """Rows (from 0) that carry no weight."""
        return self._read("screened_rows", tuple[int, ...], ())

    @property
    def data_sha256(self) -> str:
        """Hash of joints and positions."""
        return str(self.document.get("data_sha256", ""))

    @property
    def sources(self) -> tuple[str, ...]:
        """Files of the rows."""
        return self._read("sources", tuple[str, ...], ())

    @property
    def provenance(self) -> object:
        """JSON values of the provenance; None before it was recorded."""
        return self.document.get("provenance")

    @property
    def lineage(self) -> tuple[Mapping[str, object], ...]:
        """Steps that made the model after its first fit, oldest first; see :func:`read_step`."""
        return self._read("lineage", tuple[dict[str, object], ...], ())

    @property
    def verdict(self) -> str:
        """``determined`` or ``conditional``."""
        return str(self.document.get("verdict", ""))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about what to watch."""
        return self._read("doubts", tuple[str, ...], ())

    @property
    def terms(self) -> tuple[str, ...]:
        """Sentences about what further error terms learned."""
        return self._read("terms", tuple[str, ...], ())

    @property
    def unseen(self) -> tuple[Unseen, ...]:
        """Combinations of parameters the data could not see."""
        return self._read("unseen", tuple[Unseen, ...], ())

    @property
    def joint_range(self) -> Array | None:
        """(2, dof) rad, lowest and highest joint values of the rows."""
        stated = np.asarray(self.document.get("joint_range_rad", ()), dtype=np.float64)
        return stated if stated.ndim == 2 and len(stated) == 2 else None

    @property
    def parameters(self) -> Mapping[str, EstimatedParameter] | None:
        """Robot parameters by name."""
        stated = self._read("parameters", dict[str, dict[str, float | str]], None)
        if stated is None:
            return None
        return {
            name: EstimatedParameter(
                value=float(entry["value"]), sd=float(entry["sd"]), kind=str(entry["class"])
            )
            for name, entry in stated.items()
        }

    @property
    def white_sd(self) -> float | None:
        """M per axis, white noise learned beyond instrument and repeatability."""
        return self._number("white_sd_m")

    @property
    def white_turn_sd(self) -> float | None:
        """Rad per axis, the same of orientations."""
        return self._number("white_sd_rad")

    @property
    def rms(self) -> float | None:
        """m, residual of the training poses; not the accuracy."""
        return self._number("rms_m")

    @property
    def held_out_mean(self) -> float | None:
        """m, mean 3-D error on held-out blocks of the training poses."""
        return self._number("held_out_blocks_mean_m")

    @property
    def relation(self) -> str:
        """Relation of a transfer: ``region``, ``campaign`` or ``unit``."""
        return str(self.document.get("relation", ""))

    @property
    def drift_scales(self) -> Mapping[str, float]:
        """Distance of a transfer's target from its source, by group."""
        return self._read("drift_scales", dict[str, float], {})

    @property
    def drift_defaults(self) -> Mapping[str, float]:
        """Usual distances of a transfer."""
        return self._read("drift_defaults", dict[str, float], {})

    @property
    def selection(self) -> Mapping[str, object] | None:
        """JSON values of how the method was selected, if it was."""
        return self._read("selection", dict[str, object], None)

    @property
    def guard(self) -> Mapping[str, object] | None:
        """JSON values of the verdict on a transfer, if it was guarded."""
        return self._read("guard", dict[str, object], None)

    def _number(self, key: str) -> float | None:
        return self._read(key, float, None)

    def _read(self, key: str, kind: type[T], missing: U) -> T | U:
        """Returns the entry of a key; ``missing`` where the model never recorded it.

        Raises:
            ArchiveError: It is of another type.
        """
        stated = self.document.get(key)
        return missing if stated is None else decode(kind, stated, key=f"summary.{key}")
