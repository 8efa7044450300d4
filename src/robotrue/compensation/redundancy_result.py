"""Result of choosing the free rotation of a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robotrue.compensation.result import Compensation
from robotrue.compensation.status import Status
from robotrue.core.arm_words import NO_WORD
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.units import DEG, UM
from robotrue.program.program import Program

_SHOWN = (
    ("stiffness_N_per_um", "stiffness", 1.0 / UM, np.min, "stiffness along the force", "N/um"),
    ("deflection_across_feed_um", "across", UM, np.max, "deflection across the feed", "um"),
    ("limit_distance_deg", "room", DEG, np.min, "distance from joint limits", "deg"),
    ("wrist_angle_deg", "wrist", DEG, np.min, "angle of axes 4 and 6", "deg"),
)
"""Key, attribute of :class:`PostureQuality`, size and worst of it, name, unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PostureQuality:
    """Quality of the arm's posture at n targets; NaN where it is unknown.

    Attributes:
        joints: (n, 6) rad, nominal.
        room: (n,) rad to the nearest joint limit.
        wrist: (n,) rad between axes 4 and 6.
        across: (n,) m, what the process force bends the arm by across the feed.
        stiffness: (n,) N/m along the force; NaN without force.
    """

    joints: Array
    room: Array
    wrist: Array
    across: Array
    stiffness: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SpinChoice:
    """A program with newly chosen free rotations.

    Attributes:
        program: With new attitudes and configuration words; its bytes are unchanged.
        spin: (n,) rad about the cutter axis, from the attitude written; 0 where it stays.
        turned: (n,) targets with another attitude.
        before: Stance of the arm with the program as written.
        after: With the new one.
        runs: Number of runs, and of turned runs.
        notes: One sentence each.
    """

    program: Program
    spin: Array
    turned: BoolArray
    before: PostureQuality
    after: PostureQuality
    runs: tuple[int, int]
    notes: tuple[str, ...]

    def summary(self) -> dict[str, object]:
        """Returns JSON values over the turned targets: what was won, as the model predicts it."""
        at = self.turned
        out: dict[str, object] = {
            "runs": self.runs[0],
            "runs_turned": self.runs[1],
            "targets_turned": int(at.sum()),
            "largest_spin_deg": float(np.abs(self.spin).max(initial=0.0) / DEG),
        }
        for name, of, unit, worst, *_ in _SHOWN:
            pair = [np.asarray(getattr(each, of))[at] for each in (self.before, self.after)]
            both = np.isfinite(pair[0]) & np.isfinite(pair[1])
            if both.any():
                out[name] = {
                    when: {
                        "mean": float(value[both].mean() / unit),
                        "worst": float(worst(value[both]) / unit),
                    }
                    for when, value in zip(("before", "after"), pair, strict=True)
                }
        return out

    def restate(self, program: Program, result: Compensation) -> Compensation:
        """Returns the compensation of the new program as one of the program that was read.

        Targets that were turned and then not compensated keep their place and get their attitude.

        Args:
            program: As read.
            result: Of compensating :attr:`program`.
        """
        new = result.replacement
        moved = np.asarray(self.turned & ~new.changed)
        words = np.where(
            (new.words == NO_WORD) & (self.program.words != program.words),
            self.program.words,
            new.words,
        )
        rotation = np.array(new.rotation)
        rotation[moved] = self.program.rotation[moved]
        position = np.array(new.position)
        position[moved] = program.position[moved]
        said = {
            each: int((result.status[moved] == each).sum())
            for each in Status
            if each != Status.UNCHANGED_NO_ERROR
        }
        notes = tuple(
            f"{count} targets were turned and not compensated: {status.explanation}."
            for status, count in said.items()
            if count
        )
        return replace(
            result,
            replacement=replace(
                new, changed=new.changed | moved, position=position, rotation=rotation, words=words
            ),
            remarks=(*result.remarks, *notes),
        )


def spin_sentences(won: Mapping[str, Any]) -> list[str]:
    """Returns what was won, one sentence each."""
    out = [
        f"tool axis: {won['targets_turned']} targets turned in {won['runs_turned']} of "
        f"{won['runs']} runs, at most by {won['largest_spin_deg']:.1f} deg"
    ]
    for key, *_, what, unit in _SHOWN:
        if key in won:
            old, new = won[key]["before"], won[key]["after"]
            out.append(
                f"predicted {what}: {old['mean']:.3g} {unit} mean, {old['worst']:.3g} worst before;"
                f" {new['mean']:.3g} mean, {new['worst']:.3g} worst after"
            )
    return out
