"""Find offset and drift between two recorded clocks from a jog."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, PlainResult
from robotrue.app.request import InputFile, Output, Request
from robotrue.app.request_fields import OUTPUT
from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import marked_document, merge, read_provenance
from robotrue.errors import ImplausibleDataError

if TYPE_CHECKING:
    from robotrue.core.arrays import Array, BoolArray
    from robotrue.online.blocks import Block
    from robotrue.online.clock_alignment import ClockAlignment


class SenseAlignRequest(Request):
    """Two records of one jog."""

    joints: Annotated[Path, InputFile(argument="JOINTS.csv")]
    """Recorded joints of the jog."""
    force: Annotated[Path, InputFile(argument="FORCE")]
    """Recorded force of the same jog: CSV or TDMS."""
    output: Annotated[Path, Output(names=OUTPUT, what="JSON", suffixes=(".json",))]
    """Clock file to write (JSON)."""
    most_s: float = 1.0
    """Largest shift between the clocks."""


@operation()
def run(request: SenseAlignRequest, context: Context) -> PlainResult:
    """Writes the clock file and reports the uncertainty of the alignment.

    Raises:
        FormatError: A record that cannot be read.
        ImplausibleDataError: Records without anything in common.
        ObservabilityError: The jog shows too little, or two shifts about as well.
    """
    from robotrue.online.clock_alignment import clock_document, write_clock

    joints, force = request.joints, request.force
    alignment, by_host = _alignment(joints, force, request.most_s)
    sources = {"joints": sha256(read_bytes(joints)), "force": sha256(read_bytes(force))}
    origin = merge([read_provenance(joints), read_provenance(force)])
    document = marked_document(clock_document(alignment, host=by_host, sources=sources), origin)
    write_clock(context.output(request.output), document)
    return PlainResult(
        values=document,
        shown=(Facts(title="clocks", rows=_facts(alignment, by_host)),),
        provenance=origin,
    )


def _facts(found: ClockAlignment, by_host: bool) -> tuple[tuple[str, str], ...]:
    return (
        ("force is late by", f"{1e3 * found.offset:.2f} +- {1e3 * found.offset_sd:.2f} ms"),
        ("drift", f"{1e6 * found.drift:.1f} +- {1e6 * found.drift_sd:.1f} ppm"),
        ("joints explain", f"{100.0 * found.explained:.2f} % of the force"),
        ("best other shift", f"{100.0 * found.rival:.2f} %"),
        ("joints moved for", f"{found.moved:.1f} s"),
        ("clock", "host" if by_host else "recorder"),
    )


def _alignment(joints: Path, force: Path, most: float) -> tuple[ClockAlignment, bool]:
    """The alignment, and whether it is of the host's clock."""
    import numpy as np

    from robotrue.online.clock_alignment import align_streams
    from robotrue.online.replay_blocks import Repeats, force_blocks, joint_blocks

    joint_samples = list(joint_blocks(joints, Repeats()))
    force_samples = list(force_blocks(force, Repeats(), frame="sensor"))
    joint_time, joint_host, joint_good = _times(joint_samples, joints)
    angles = np.concatenate([block.joints for block in joint_samples])[joint_good]
    force_time, force_host, force_good = _times(force_samples, force)
    wrench = np.concatenate([block.wrench for block in force_samples])[force_good]
    wrench = wrench[:, :3] if np.isnan(wrench[:, 3:]).any() else wrench
    if joint_host != force_host:
        named = (joints, force) if joint_host else (force, joints)
        raise ImplausibleDataError(
            f"{named[0].name} has times of the host and {named[1].name} has none: their clocks "
            "have nothing in common.",
            hint="host_s in both, or in neither.",
        )
    return align_streams(joint_time, angles, force_time, wrench, most=most), joint_host


def _times(blocks: Sequence[Block], path: Path) -> tuple[Array, bool, BoolArray]:
    """When valid samples were taken, whether by the host's clock, and which those are."""
    import numpy as np

    from robotrue.online.clocks import StreamClock

    controller = np.concatenate([b.controller_time for b in blocks])
    host = np.concatenate([b.host_time for b in blocks])
    valid = np.concatenate([b.valid for b in blocks])
    if not valid.any():
        raise ImplausibleDataError("no valid sample.", source=path)
    time, doubt = StreamClock().align(controller, host)
    sound = valid & ~doubt & np.isfinite(time)
    return time[sound], bool((host[valid] != controller[valid]).any()), sound
