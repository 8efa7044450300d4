"""Every place where the paper can be read two ways, without the libraries that compute it.

:class:`DengReadings` holds those of the transfer; the rules for target poses are applied by
``sampling``, the readings of eq. 9-10 by ``similarity``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Final, Literal, TypeAlias, get_args, get_origin, get_type_hints

from robotrue.errors import ConfigurationError

TransformReading: TypeAlias = Literal["known-angle", "least-squares", "literal"]
AttitudeReading: TypeAlias = Literal["turning", "fixed"]
AlignmentInputs: TypeAlias = Literal["positions", "pose"]
RidgeReading: TypeAlias = Literal["leave-one-out", "fixed"]
ShrinkReading: TypeAlias = Literal["zero", "rotation"]
WeightReading: TypeAlias = Literal["none", "columns", "rows"]
SourceWeights: TypeAlias = Literal["frozen", "literal", "pardoe", "decay"]
ErrorOver: TypeAlias = Literal["target", "all"]
BoostingWeights: TypeAlias = Literal["poses", "mean", "none"]
SourceStart: TypeAlias = Literal["once", "same"]
Combination: TypeAlias = Literal["weighted-median", "literal"]
Kernel: TypeAlias = Literal["ard", "isotropic"]
Mean: TypeAlias = Literal["constant", "zero"]
Denominator: TypeAlias = Literal["squared", "literal"]
Outside: TypeAlias = Literal["raise", "nearest"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DengReadings:
    """Readings of the ambiguous or faulty equations; the defaults are the readings that work.

    The effect of each switch was measured on simulated arms; ``robotrue reproduce deng2022`` prints
    it.

    Attributes:
        transform: T_j, eq. 11-12. ``known-angle``: eq. 11 with the angle between the two nominal
            regions and no translation. ``least-squares``: (Xst'Xst)^-1 Xst' Xt from the mapped
            pairs; for nominal poses it returns the same, transpo. ``literal``: eq. 12 as printed
            multiplies n source rows with m mapped rows; it raises.
        attitude: Effect of T_j on the tool's attitude, which eq. 11 does not define: it turns with
            joint 1 (rz grows by the angle), or stays as it is in the base.
        inputs: X in eq. 13-15. ``positions``: H_j has 7 rows (position, error, 1). ``pose``: all
            six pose numbers of x, 10 rows; needs more target poses for the same accuracy.
        ridge: lambda of eq. 14, which the paper does not give. ``leave-one-out``: the value with
            the smallest leave-one-out residual, by sub-space. ``fixed``: ``ridge_value``.
        ridge_value: lambda with positions and errors in mm and angles in deg.
        shrink_to: Where lambda pulls H_j. ``rotation``: to "the error turns with the pose".
            ``zero``: as printed; a large lambda then predicts no error at all.
        alignment_weights: omega_m in eq. 13. ``columns``: as printed; a weight on output columns
            cannot change a least-squares solution. ``rows``: each pair by its tracker variance.
            ``none``: without.
        boosting_weights: omega_m in eq. 20-21: errors count in units of what the tracker resolves.
            ``poses``: three numbers for each pose, as section 2.1 defines them. ``mean``: their
            mean over the target poses. ``none``: without.
        rounds: N, largest number of boosting rounds.
        source_start: Eq. 19 gives source rows no weight to begin with. ``once``: the k copies of a
            source row share the weight of one target row, because it was measured once. ``same``:
            each copy has the weight of a target row.
        source_weights: Eq. 24. ``literal``: ln(1/beta_t) for every transferred row, some hundred
            times a target row. ``frozen``: stays as it began (two-stage TrAdaBoost.R2).
            ``pardoe``: w beta^e with the beta of TrAdaBoost. ``decay``: see
            :class:`robotrue.calibration.learners.tradaboost.TrAdaBoostR2`.
        error_over: Eq. 22. ``target``: weights summing to 1 over the target rows. ``all``: over all
            rows as printed, which scales the error by the target's share.
        combination: Eq. 25. ``weighted-median``: of the rounds' predictions, weights ln(1/beta_t).
            ``literal``: the sum of the logarithms times a median of beta_t G_t; its scale is wrong.
        kernel: Eq. 28. ``ard``: a length for each input, inputs standardi. ``isotropic``: one
            length for mm and deg together.
        mean: Eq. 27 has a constant mean, eq. 31 none.
        denominator: Eq. 28 divides by 2 sigma_l where a length scale is squared; learned lengths
            come out the same process.
        length: A fixed isotropic kernel length, mm and deg alike; None learns it.
        kernel_rows: Hyper-parameters of the boosted kernel are learned on this many rows, evenly
            spaced; the paper does not state the method.
        overlap_weight: sigma_in of eq. 19, weight of target rows that lie in two sub-spaces.
        outside: Rule of the joined model, eq. 26, outside both domains: refuse, or use the nearer
            domain's.
    """

    transform: TransformReading = "known-angle"
    attitude: AttitudeReading = "turning"
    inputs: AlignmentInputs = "positions"
    ridge: RidgeReading = "leave-one-out"
    ridge_value: float = 1e-3
    shrink_to: ShrinkReading = "rotation"
    alignment_weights: WeightReading = "none"
    boosting_weights: BoostingWeights = "poses"
    rounds: int = 10
    source_start: SourceStart = "once"
    source_weights: SourceWeights = "frozen"
    error_over: ErrorOver = "target"
    combination: Combination = "weighted-median"
    kernel: Kernel = "ard"
    mean: Mean = "constant"
    denominator: Denominator = "squared"
    length: float | None = None
    kernel_rows: int = 200
    overlap_weight: float = 1.0
    outside: Outside = "raise"

    def __post_init__(self) -> None:
        """Refuses words and numbers that mean nothing."""
        for name, hint in get_type_hints(DengReadings).items():
            if get_origin(hint) is Literal and getattr(self, name) not in get_args(hint):
                raise ConfigurationError(
                    f"{name} {getattr(self, name)!r}; readings are {list(get_args(hint))}."
                )
        if self.rounds < 1:
            raise ConfigurationError(f"{self.rounds} boosting rounds, expected 1 or more.")
        if self.kernel_rows < 20:
            raise ConfigurationError(f"kernel_rows {self.kernel_rows}, expected 20 or more.")
        if not self.ridge_value >= 0.0:
            raise ConfigurationError(f"ridge_value {self.ridge_value}, expected 0 or more.")
        if not self.overlap_weight > 0.0:
            raise ConfigurationError(f"overlap_weight {self.overlap_weight}, expected more than 0.")
        if self.length is not None and not self.length > 0.0:
            raise ConfigurationError(f"length {self.length} mm, expected more than 0.")


Boosting: TypeAlias = Literal["corrected", "literal"]
BOOSTING: Final[Boosting] = "corrected"
LITERAL_BOOSTING: Final[Mapping[str, str]] = MappingProxyType(
    {"source_start": "same", "error_over": "all", "source_weights": "literal"}
)
"""Eq. 19, 22 and 24 as printed."""


def parse_readings(texts: Iterable[str], **stated: object) -> DengReadings:
    """Returns the readings of texts NAME=VALUE on top of stated ones, defaults for the others.

    Raises:
        ConfigurationError: No such reading, or a value it cannot have.
    """
    values = dict(stated)
    kinds = get_type_hints(DengReadings)
    for text in texts:
        name, equals, value = text.partition("=")
        if name not in kinds or not equals:
            raise ConfigurationError(
                f"reading {text!r}, expected NAME=VALUE with one of {', '.join(kinds)}.",
                hint="--reading shrink_to=zero",
            )
        values[name] = _reading_value(name, value, kinds[name])
    return DengReadings(**values)  # type: ignore[arg-type]  # checked by its own rules


def _reading_value(name: str, text: str, kind: object) -> object:
    if get_origin(kind) is Literal:
        return text
    try:
        return int(text) if kind is int else float(text)
    except ValueError:
        raise ConfigurationError(
            f"reading {name}={text!r}, expected a number.", hint=f"--reading {name}=10"
        ) from None


def changed_readings(readings: DengReadings) -> dict[str, object]:
    """Returns the readings that are not the default, by name."""
    usual = asdict(DengReadings())
    return {name: value for name, value in asdict(readings).items() if value != usual[name]}


TargetRule: TypeAlias = Literal["random", "boundary", "corners", "space-filling"]
"""Rule 3 and its alternatives."""
RULES: Final[tuple[TargetRule, ...]] = get_args(TargetRule)
TARGET_RULE: Final[TargetRule] = "random"


SimilarityReading: TypeAlias = Literal[
    "per-point", "swapped", "shared", "per-axis", "raw", "coordinates"
]
SIMILARITY_READINGS: Final[tuple[SimilarityReading, ...]] = get_args(SimilarityReading)
SIMILARITY_READING: Final[SimilarityReading] = "per-point"
"""Closest to the paper's Table 4."""
