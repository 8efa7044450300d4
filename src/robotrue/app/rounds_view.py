"""What rounds at the machine answer: JSON values, a row a round, floor and oscillation apart."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import numpy as np

from robotrue.app.presentation import Block, Facts, Note, Table
from robotrue.cell.registration.rounds import Pass, RoundsResult
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM

SAYS: Final = {
    "run again": "run the part's points once more in the frame written, and touch them",
    "settled": "stop: the last correction is below its own uncertainty",
    "as it was": "stop: the frame begun with is as good as touching can tell, and stays",
    "not settled": "stop: the part moves, or touches are worth less than stated",
}


def rounds_document(rounds: RoundsResult) -> dict[str, object]:
    """Returns JSON values; mm, deg."""
    end = rounds.adjustment
    return {
        "rounds_verdict": end.verdict,
        "rounds": [
            {
                "round": k + 1,
                "run_xyz_mm": (T[:3, 3] / MM).tolist(),
                "run_abc_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
                "deviation_mm": (each.error / MM).tolist(),
                "worst_mm": each.worst / MM,
                "correction_mm": float(np.linalg.norm(each.shift)) / MM,
                "correction_deg": each.angle / DEG,
                "times_its_uncertainty": _times(each),
            }
            for k, (each, T) in enumerate(zip(end.passes, rounds.frames, strict=True))
        ],
        "floor_mm": _number(end.floor),
        "oscillation_mm": _number(end.oscillation),
        "distortion_mm": (end.distortion / MM).tolist()
        if np.isfinite(end.distortion).all()
        else None,
        "counted_rounds": rounds.counted,
        "moved": [
            {"round": m.round, "mm": m.shift / MM, "deg": m.turn / DEG, "times": m.times}
            for m in rounds.moved
        ],
    }


def rounds_blocks(rounds: RoundsResult) -> Iterable[Block]:
    """Returns a row a round, and where they ended."""
    end = rounds.adjustment
    yield Table(
        title="rounds",
        columns=("", "worst deviation, mm", "correction, mm", "deg", "times its uncertainty"),
        rows=tuple(
            (
                str(k + 1),
                f"{each.worst / MM:.3f}",
                f"{float(np.linalg.norm(each.shift)) / MM:.3f}",
                f"{each.angle / DEG:.4f}",
                f"{_times(each):.1f}",
            )
            for k, each in enumerate(end.passes)
        ),
    )
    facts = [("verdict", f"{end.verdict}: {SAYS[end.verdict]}")]
    if np.isfinite(end.floor):
        facts.append(("floor", f"{end.floor / MM:.3f} mm: the triangle as this arm sees it"))
    if np.isfinite(end.oscillation):
        facts.append(("oscillation", f"{end.oscillation / MM:.3f} mm: the touching"))
    yield Facts(title="where they ended", rows=tuple(facts))
    yield from (
        Note(
            f"note: before round {m.round} the part moved by {m.shift / MM:.3f} mm and "
            f"{m.turn / DEG:.3f} deg, {m.times:.1f} times what touching explains; the rounds "
            "before are left out."
        )
        for m in rounds.moved
    )


def _times(each: Pass) -> float:
    """Length of a correction over its standard deviation, per direction."""
    return float(np.sqrt(each.significance / 6.0))


def _number(value: float) -> float | None:
    return value / MM if np.isfinite(value) else None
