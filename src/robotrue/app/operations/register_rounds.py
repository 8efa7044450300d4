"""Adjust the part frame at the machine in rounds: run, probe, correct."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Facts, Note, PlainResult, Table
from robotrue.app.request import InputFile, Request
from robotrue.app.request_fields import (
    CellOrModel,
    FrameFormats,
    FrameNumber,
    PartTolerance,
    ToolSigma,
    TouchSigma,
    cell_output,
)
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.validation.validation_defaults import FRAME_NUMBER, REGISTRATION_METHOD, TOUCH_MM

if TYPE_CHECKING:
    from robotrue.cell.registration.rounds import Pass, RoundsResult


class RegisterRoundsRequest(Request):
    """Probed rounds, and the frame of the first round."""

    cell: CellOrModel
    rounds: Annotated[tuple[Path, ...], InputFile(argument="ROUND...")]
    """CSV of the touches of each round, the first one first."""
    output: Annotated[Path, cell_output()]
    """Cell with the frame for the next run."""
    frame: str | None = None
    """X,Y,Z,A,B,C of the part in the first run; default: from CELL."""
    method: Literal["touches", "feng2018"] = REGISTRATION_METHOD
    """touches: all count; feng2018: three points, right angle at the first."""
    touch_sigma_mm: TouchSigma = TOUCH_MM
    tool_sigma_mm: ToolSigma = None
    tolerance_mm: PartTolerance = None
    frame_format: FrameFormats = ()
    frame_number: FrameNumber = FRAME_NUMBER


@operation()
def run(request: RegisterRoundsRequest, context: Context) -> PlainResult:
    """Adjusts, and writes the cell for the next run.

    Raises:
        ConfigurationError: A format of frames, or the part's first position is not stated.
        ObservabilityError: Touches that do not fix the part.
        ImplausibleDataError: Rounds that are not of one part.
    """
    import numpy as np

    from robotrue.app.registered import model_file_of, open_arm, registered_cell, relative_name
    from robotrue.app.registration_view import (
        frames_document,
        registration_blocks,
        registration_document,
        write_frames,
    )
    from robotrue.app.touch_settings import registration_settings
    from robotrue.measurement.formats.part_points import read_points
    from robotrue.planning.work_area import rough_frames
    from robotrue.program.controller_frames import controller_frame
    from robotrue.robot.configuration import axis_relation
    from robotrue.validation.registration_rounds import register_in_rounds

    output, source = context.output(request.output), context.cell_file(request.cell)
    for form in request.frame_format:
        controller_frame(np.eye(4), form, number=request.frame_number)  # refuses before any work
    cell, arm = open_arm(source)
    files = [read_points(path, axis_relation(cell.robot)) for path in request.rounds]
    for path, file in zip(request.rounds, files, strict=True):
        if len(file.parts) > 1:
            raise ConfigurationError(
                f"touches of {len(file.parts)} parts: {', '.join(file.parts)}.",
                source=path,
                hint="one part, or one side, at a time.",
            )
    name = files[0].parts[0]
    found, rounds = register_in_rounds(
        arm,
        [file.touches for file in files],
        rough_frames(cell, request.frame, (name,))[0],
        name=name,
        settings=registration_settings(
            cell,
            request.touch_sigma_mm,
            tool_sigma_mm=request.tool_sigma_mm,
            tolerance_mm=request.tolerance_mm,
            fit="frame",
            method=request.method,
        ),
    )
    used = model_file_of(cell, source)
    table = found.table(
        model_file="" if used is None else relative_name(used, output),
        points_file=request.rounds[-1].name,
        points_sha256=files[-1].digest,
    )
    data = registered_cell(cell, source, table, output)
    context.write(output, data, "cell for the next run")
    frames = write_frames(found.frames, request.frame_format, request.frame_number)
    lines = [frame.text for _, frame in frames]
    return PlainResult(
        values={
            "cell": str(output),
            **registration_document(found),
            **_rounds_document(rounds),
            "frames": frames_document(frames),
        },
        shown=(*_rounds_blocks(rounds), *registration_blocks(found, lines)),
        provenance=found.provenance,
    )


SAYS: Final = {
    "run again": "run the part's points again in the written frame and probe them",
    "settled": "stop: the last correction is below its own uncertainty",
    "as it was": "stop: no correction exceeds the touch uncertainty; the first frame is saved",
    "not settled": "stop: the part moves, or touches are less accurate than stated",
}


def _rounds_document(rounds: RoundsResult) -> dict[str, object]:
    """Returns JSON values; mm, deg."""
    import numpy as np

    from robotrue.core.rotations import abc_from_matrix

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


def _rounds_blocks(rounds: RoundsResult) -> Iterable[Block]:
    """Returns one row per round, and the result."""
    import numpy as np

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
        facts.append(
            ("floor", f"{end.floor / MM:.3f} mm: error of the triangle measured by this arm")
        )
    if np.isfinite(end.oscillation):
        facts.append(("oscillation", f"{end.oscillation / MM:.3f} mm: scatter of the touches"))
    yield Facts(title="result", rows=tuple(facts))
    yield from (
        Note(
            f"note: before round {m.round} the part moved by {m.shift / MM:.3f} mm and "
            f"{m.turn / DEG:.3f} deg, {m.times:.1f} times the touch uncertainty; the rounds "
            "before are left out."
        )
        for m in rounds.moved
    )


def _times(each: Pass) -> float:
    """Length of a correction over its standard deviation, per direction."""
    import numpy as np

    return float(np.sqrt(each.significance / 6.0))


def _number(value: float) -> float | None:
    import numpy as np

    return value / MM if np.isfinite(value) else None
