"""``robotrue sense align``: two records of one jog in, a clock file out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robotrue.app.outputs import check_output
from robotrue.cli.console import emit_facts, emit_json, say_mark
from robotrue.core.arrays import Array, BoolArray
from robotrue.core.files import read_bytes, sha256
from robotrue.core.provenance import marked_document, merge, read_provenance
from robotrue.errors import ImplausibleDataError
from robotrue.online.blocks import Block
from robotrue.online.clock_alignment import align_streams
from robotrue.online.clock_file import clock_document, write_clock
from robotrue.online.clocks import StreamClock
from robotrue.online.replay_blocks import Repeats, force_blocks, joint_blocks


def run(joints: Path, force: Path, output: Path, *, most: float, as_json: bool) -> None:
    """Writes the clock file and says how well the jog has shown it.

    Raises:
        FormatError: A record that cannot be read.
        ImplausibleDataError: Records without anything in common.
        ObservabilityError: The jog shows too little, or two shifts about as well.
    """
    check_output(output, [joints, force])
    moved = list(joint_blocks(joints, Repeats()))
    pushed = list(force_blocks(force, Repeats(), frame="sensor"))
    joint_time, joint_host, sound = _times(moved, joints)
    angles = np.concatenate([b.joints for b in moved])[sound]
    force_time, force_host, good = _times(pushed, force)
    wrench = np.concatenate([b.wrench for b in pushed])[good]
    wrench = wrench[:, :3] if np.isnan(wrench[:, 3:]).any() else wrench
    if joint_host != force_host:
        named = (joints, force) if joint_host else (force, joints)
        raise ImplausibleDataError(
            f"{named[0].name} has times of the host and {named[1].name} has none: their clocks "
            "have nothing in common.",
            hint="host_s in both, or in neither.",
        )
    found = align_streams(joint_time, angles, force_time, wrench, most=most)
    sources = {"joints": sha256(read_bytes(joints)), "force": sha256(read_bytes(force))}
    origin = merge([read_provenance(joints), read_provenance(force)])
    say_mark(origin)
    document = marked_document(clock_document(found, host=joint_host, sources=sources), origin)
    write_clock(output, document)
    if as_json:
        emit_json(document)
        return
    emit_facts(
        "clocks",
        [
            ("force is late by", f"{1e3 * found.offset:.2f} +- {1e3 * found.offset_sd:.2f} ms"),
            ("drift", f"{1e6 * found.drift:.1f} +- {1e6 * found.drift_sd:.1f} ppm"),
            ("joints explain", f"{100.0 * found.explained:.2f} % of the force"),
            ("best other shift", f"{100.0 * found.rival:.2f} %"),
            ("joints moved for", f"{found.moved:.1f} s"),
            ("clock", "host" if joint_host else "recorder"),
        ],
        origin,
    )


def _times(blocks: Sequence[Block], path: Path) -> tuple[Array, bool, BoolArray]:
    """When valid samples were taken, whether by the host's clock, and which those are."""
    controller = np.concatenate([b.controller_time for b in blocks])
    host = np.concatenate([b.host_time for b in blocks])
    valid = np.concatenate([b.valid for b in blocks])
    if not valid.any():
        raise ImplausibleDataError("no valid sample.", source=path)
    time, doubt = StreamClock().align(controller, host)
    sound = valid & ~doubt & np.isfinite(time)
    return time[sound], bool((host[valid] != controller[valid]).any()), sound
