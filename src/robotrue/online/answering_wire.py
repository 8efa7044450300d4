"""What the service and its answering process tell each other, one message each, over a socket pair.

A message is ``I`` bytes of JSON, the JSON, and a frame of the record where it holds samples. The
socket keeps messages whole, so neither side ever reads half of one.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields, replace
from typing import Any, Final, TypeVar

from robotrue import errors
from robotrue.core.columns import concat
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online.blocks import Block, ForceBlock, JointBlock
from robotrue.online.egm import RobotWare
from robotrue.online.egm_link import EgmSettings
from robotrue.online.guard import CorrectionLimits, GuardState
from robotrue.online.link import Health
from robotrue.online.record_frames import HEAD, Kind, frame_bytes, frame_from
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.robot_link import LinkState
from robotrue.online.rsi_config import parse_rsi_config, write_rsi_config
from robotrue.online.rsi_link import RsiSettings
from robotrue.online.sequence import SequenceState
from robotrue.online.udp import Address

LinkSettings = RsiSettings | EgmSettings
Document = Mapping[str, Any]
B = TypeVar("B", JointBlock, ForceBlock)

MOST: Final = 1 << 17
"""Bytes of a message, at most."""
_ROWS: Final = 256
"""Samples in one message: with twelve axes half of what a message may hold."""
_LENGTH: Final = struct.Struct("<I")


def message(document: Document, frame: bytes = b"") -> bytes:
    """Returns the bytes of a message."""
    text = json.dumps(document, separators=(",", ":")).encode()
    return b"".join((_LENGTH.pack(len(text)), text, frame))


def read_message(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Returns the JSON object of a message, and its frame or nothing."""
    end = _LENGTH.size + _LENGTH.unpack_from(data)[0]
    document: dict[str, Any] = json.loads(data[_LENGTH.size : end])
    return document, data[end:]


def plain(state: SequenceState | GuardState | LinkState | Health) -> dict[str, Any]:
    """Returns the fields of a state as JSON values; sooner than ``asdict`` does."""
    found = {name: getattr(state, name) for name in state.__slots__}
    if isinstance(state, LinkState):
        found["watch"] = plain(state.watch)
    return found


def frames(block: Block) -> Iterator[bytes]:
    """Gives a block as frames that fit into messages."""
    kind = Kind.JOINTS if isinstance(block, JointBlock) else Kind.FORCE
    if len(block) <= _ROWS:
        yield frame_bytes(kind, 0, block)
        return
    for start in range(0, len(block), _ROWS):
        yield frame_bytes(kind, 0, block.take(slice(start, start + _ROWS)))


def decode_block(frame: bytes) -> Any:
    """Returns the block of a frame."""
    return frame_from(frame[: HEAD.size], frame[HEAD.size :]).content


def settings_document(settings: LinkSettings) -> dict[str, Any]:
    """Returns the settings of a link as JSON values."""
    found = {f.name: getattr(settings, f.name) for f in fields(settings)}
    found["mode"] = None if settings.mode is None else settings.mode.value
    if isinstance(settings, RsiSettings):
        # a port that is free for all is none that a controller can have
        port = settings.config.port
        config = write_rsi_config(replace(settings.config, port=max(port, 1))).decode()
        return found | {"scheme": "rsi", "config": config, "config_port": port}
    return found | {"scheme": "egm", "generation": settings.generation.value}


def read_settings(document: Document) -> LinkSettings:
    """Returns the settings that :func:`settings_document` told of."""
    found = dict(document)
    scheme = found.pop("scheme")
    found["mode"] = None if found["mode"] is None else CorrectionMode(found["mode"])
    peer = found["peer"]
    found["peer"] = None if peer is None else (str(peer[0]), int(peer[1]))
    if scheme == "rsi":
        config = parse_rsi_config(found["config"].encode())
        found["config"] = replace(config, port=found.pop("config_port"))
        return RsiSettings(**found)
    found["generation"] = RobotWare(found["generation"])
    return EgmSettings(**found)


def guard_document(limits: CorrectionLimits, mode: CorrectionMode) -> dict[str, Any]:
    """Returns what a guard is made of as JSON values."""
    return {"limits": asdict(limits), "mode": mode.value}


def read_guard(document: Document) -> tuple[CorrectionLimits, CorrectionMode]:
    """Returns what :func:`guard_document` told of."""
    return CorrectionLimits(**document["limits"]), CorrectionMode(document["mode"])


def guard_state(document: Document) -> GuardState:
    """Returns the state of a guard from its fields."""
    shift, turn = (_steps(document[name]) for name in ("shift", "turn"))
    pending = _steps(document["pending"][0]), _steps(document["pending"][1])
    spread = tuple(document["spread"])
    held = {"shift": shift, "turn": turn, "pending": pending, "spread": spread}
    return GuardState(**{**document, **held})


def link_state(document: Document) -> LinkState:
    """Returns the state of a link from its fields."""
    watch, peer = read_watch(document)
    return LinkState(**{**document, "watch": watch, "peer": peer})


def read_watch(document: Document) -> tuple[SequenceState, Address | None]:
    """Returns the count of a controller's packets, and who sends them."""
    peer = document["peer"]
    peer = None if peer is None else (str(peer[0]), int(peer[1]))
    return SequenceState(**document["watch"]), peer


def read_health(document: Document) -> Health:
    """Returns the counters from their fields."""
    return Health(**document)


def fault_document(fault: RobotrueError) -> dict[str, Any]:
    """Returns an error as JSON values."""
    return {
        "kind": type(fault).__name__,
        "message": fault.message,
        "source": fault.source,
        "hint": fault.hint,
    }


def read_fault(document: Document) -> RobotrueError:
    """Returns the error that :func:`fault_document` told of."""
    kind = getattr(errors, document["kind"], ConfigurationError)
    made: RobotrueError = kind(
        document["message"], source=document["source"], hint=document["hint"]
    )
    return made


def join_blocks(blocks: list[B]) -> list[B]:
    """Returns consecutive blocks of one stream as one; as many as arms differ in their joints."""
    if len({_alike(block) for block in blocks}) != 1:
        return blocks
    return [concat(blocks)]


def _alike(block: Block) -> object:
    return block.joints.shape[1] if isinstance(block, JointBlock) else block.frame


def _steps(values: list[int]) -> tuple[int, int, int]:
    x, y, z = values
    return x, y, z
