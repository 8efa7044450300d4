"""Results of a registration: JSON values, tables, and frames to paste."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, Literal

import numpy as np

from robotrue.app.presentation import Block, Facts, Note, Table, Text
from robotrue.core.arrays import Array
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.controller_frames import ControllerFrame, controller_frame
from robotrue.validation.registered_part import FoundFrame, RegisteredPart

SHOWN: Final = 40
"""Touches in the printed table."""


def registration_document(found: RegisteredPart) -> dict[str, object]:
    """Returns JSON values: those of the first part at the top, all parts under ``parts``."""
    parts = [_part_document(frame) for frame in found.frames]
    several = len(parts) > 1
    first = parts[0].copy()
    if several:
        names = _names(found)
        lengths = [d for frame in found.frames for d in frame.registration.distances / MM]
        believed = [b for frame in found.frames for b in frame.registration.believed]
        first["residual_mm"] = dict(zip(names, map(float, lengths), strict=True))
        first["outliers"] = [n for n, good in zip(names, believed, strict=True) if not good]

    def list_lines(key: Literal["reasons", "doubts"]) -> list[str]:
        return [
            f"{frame.name}: {line}" if several else line
            for frame in found.frames
            for line in getattr(frame, key)
        ]

    return {
        **first,
        "verdict": found.verdict,
        "reasons": list_lines("reasons"),
        "doubts": [*found.doubts, *list_lines("doubts")],
        "route": found.route,
        "model": found.identity.document(),
        "touched_with": found.touched_with.document(),
        "moved_mm": found.moved / MM,
        "parts": parts,
    }


def write_frames(
    frames: Sequence[FoundFrame], formats: Sequence[str], first: int
) -> tuple[tuple[str, ControllerFrame], ...]:
    """Returns name and frame of each part in the requested controllers' formats.

    Args:
        frames: Found.
        formats: Of :func:`~robotrue.program.controller_frames.controller_frame`.
        first: Number of the first part in the controller's frame table.
    """
    return tuple(
        (
            frame.name,
            controller_frame(
                frame.registration.T_base_part, form, name=frame.name, number=first + k
            ),
        )
        for form in formats
        for k, frame in enumerate(frames)
    )


def frames_document(frames: Sequence[tuple[str, ControllerFrame]]) -> list[dict[str, str]]:
    """Returns the frames of controllers as JSON values."""
    return [
        {"part": name, "system": frame.system, "order": frame.order, "text": frame.text}
        for name, frame in frames
    ]


def _names(found: RegisteredPart) -> list[str]:
    """Returns the names of all touches, with the part's name in front where one occurs twice."""
    pairs = [(frame.name, name) for frame in found.frames for name in frame.registration.names]
    alone = len({name for _, name in pairs}) == len(pairs)
    return [name if alone else f"{part}/{name}" for part, name in pairs]


def _part_document(frame: FoundFrame) -> dict[str, object]:
    fit = frame.registration
    T = fit.T_base_part
    return {
        "part": frame.name,
        "xyz_mm": (T[:3, 3] / MM).tolist(),
        "abc_deg": (abc_from_matrix(T[:3, :3]) / DEG).tolist(),
        "residual_mm": dict(zip(fit.names, (fit.distances / MM).tolist(), strict=True)),
        "rms_mm": fit.rms / MM,
        "outliers": list(fit.outliers),
        "covariance": fit.covariance.tolist(),
        "verdict": frame.verdict,
        "reasons": list(frame.reasons),
        "doubts": list(frame.doubts),
        "touches": len(fit.names),
        "sigma_mm": fit.sigma / MM,
        "misfit": fit.misfit,
        "with_arm": frame.with_arm,
        "machined_95_mm": dict(zip(fit.names, (frame.region / MM).tolist(), strict=True)),
    }


def registration_blocks(found: RegisteredPart, controller_lines: Sequence[str]) -> Iterable[Block]:
    """Returns each frame, its touches, what is against it, and the lines for controllers."""
    for frame in found.frames:
        fit, T = frame.registration, frame.registration.T_base_part
        sd = np.sqrt(np.diag(fit.covariance))
        touches = list(zip(fit.names, fit.distances, frame.region, fit.believed, strict=True))
        yield Facts(
            title=f"{frame.name} in base, with {found.identity}",
            rows=(
                ("x, y, z", _three(T[:3, 3] / MM, "mm")),
                ("A, B, C", _three(abc_from_matrix(T[:3, :3]) / DEG, "deg")),
                ("one sigma", f"{_three(sd[:3] / MM, 'mm')}; {_three(sd[3:] / DEG, 'deg')}"),
                ("touches", f"{len(fit.names)}, of which {len(fit.outliers)} rejected"),
                ("residual rms", f"{fit.rms / MM:.4f} mm"),
                (f"{_share(frame)}, 95 %", f"{frame.region.max() / MM:.3f} mm or better"),
                ("verdict", frame.verdict),
            ),
        )
        yield Table(
            title="touches",
            columns=("", "residual mm", f"{_share(frame)}, 95 % mm", ""),
            rows=tuple(
                (name, f"{far / MM:.4f}", f"{reach / MM:.3f}", "" if good else "rejected")
                for name, far, reach, good in touches[:SHOWN]
            ),
        )
        about = f"{frame.name}: " if len(found.frames) > 1 else ""
        yield from (Note(f"no-go: {about}{reason}") for reason in frame.reasons)
        yield from (Note(f"note: {about}{doubt}") for doubt in frame.doubts)
    yield from (Note(f"note: {doubt}") for doubt in found.doubts)
    yield from (Text(f"{line}\n") for line in controller_lines)


def _share(frame: FoundFrame) -> str:
    """Describes the region at a touch; without joints the arm's share is unknown."""
    return "machined there" if frame.with_arm else "frame there"


def _three(values: Array, unit: str) -> str:
    return ", ".join(f"{float(v):.4f}" for v in values) + f" {unit}"
