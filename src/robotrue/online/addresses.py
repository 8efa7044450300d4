"""Address text -> source: ``rsi://``, ``egm://``, ``rtde://``, ``rdt://``, ``replay://``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Final, Literal, cast, overload

from robotrue.errors import ConfigurationError
from robotrue.online.answering_link import AVAILABLE, AnsweringLink
from robotrue.online.answering_wire import LinkSettings, RemoteGuard
from robotrue.online.blocks import ForceBlock, JointBlock
from robotrue.online.guard import CorrectionGuard
from robotrue.online.link import (
    ForceWithJoints,
    RobotLinkSettings,
    Role,
    StreamProtocol,
    StreamSettings,
    StreamSource,
)

PROTOCOLS: Final[Mapping[str, str]] = {
    "rsi": "robotrue.online.rsi_link",
    "egm": "robotrue.online.egm_link",
    "rtde": "robotrue.online.rtde_link",
    "rdt": "robotrue.online.rdt_link",
    "replay": "robotrue.online.replay_link",
}
"""Leaf files with a ``PROTOCOL``, by the scheme of their addresses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings(StreamSettings):
    """Settings of a source beyond its address: corrector, robot, and the process that answers.

    Attributes:
        corrector: Called by a robot's link for each of its answers; None corrects nothing. A
            :class:`~robotrue.online.answering_wire.RemoteGuard` runs in the answering process.
        robot: The robot's source, for a force that comes in the same messages (EGM).
        own_process: Whether a separate process answers an RSI or EGM robot, on Linux. A corrector
            of this process is called from a thread here in either case.
    """

    corrector: CorrectionGuard | RemoteGuard | None = None
    robot: StreamSource[JointBlock] | None = None
    own_process: bool = True


def protocol_of(address: str, role: Role = "robot") -> StreamProtocol:
    """Returns the protocol of an address.

    Args:
        address: With its scheme.
        role: Requested stream, for the hint.

    Raises:
        ConfigurationError: There is none of that scheme.
    """
    scheme, mark, _ = address.partition("://")
    module = PROTOCOLS.get(scheme.lower()) if mark else None
    if module is None:
        usual = "rsi" if role == "robot" else "rdt"
        raise ConfigurationError(
            f"source {(scheme.lower() + '://') if mark else address!r}, expected one of "
            f"{', '.join(name + '://' for name in PROTOCOLS)}.",
            hint=_import_protocol(PROTOCOLS[usual]).example,
        )
    return _import_protocol(module)


def _import_protocol(module: str) -> StreamProtocol:
    return cast(StreamProtocol, import_module(module).PROTOCOL)


@overload
def open_stream(
    address: str, role: Literal["robot"] = "robot", settings: SourceSettings | None = None
) -> StreamSource[JointBlock]: ...
@overload
def open_stream(
    address: str, role: Literal["force"], settings: SourceSettings | None = None
) -> StreamSource[ForceBlock]: ...
def open_stream(
    address: str, role: Role = "robot", settings: SourceSettings | None = None
) -> StreamSource[JointBlock] | StreamSource[ForceBlock]:
    """Opens the source of an address; robot links listen at once, other sources when first read.

    Args:
        address: As the ``example`` of a protocol, with its ``options``.
        role: Whether joints or forces are wanted.
        settings: Of the service.

    Raises:
        ConfigurationError: An unknown scheme or option, an invalid value, a stream that the other
            side does not have, or corrections that cannot be sent there.
        FormatError: A configuration or scale that cannot be read.
    """
    settings = settings or SourceSettings()
    scheme, _, rest = address.partition("://")
    if scheme.lower() != "replay" and "@" in rest.partition("?")[0]:
        raise ConfigurationError(
            f"a user in the address of a {scheme.lower()} source; none of them has users."
        )
    protocol = protocol_of(address, role)
    if settings.corrector is not None:
        require_answers(address, protocol, role)
    if role in protocol.lacks:
        raise ConfigurationError(f"{protocol.lacks[role]}.", source=address)
    if role == "force" and protocol.link_of_force is not None:
        return _force_of_robot(address, protocol.link_of_force(address), settings.robot)
    found = protocol.read(address, role, settings)
    if isinstance(found, RobotLinkSettings):
        return _answer(found, settings)
    return cast("StreamSource[JointBlock] | StreamSource[ForceBlock]", found)


def require_answers(address: str, protocol: StreamProtocol, role: Role = "robot") -> None:
    """Passes if corrections can be sent to the robot of an address.

    Raises:
        ConfigurationError: It takes none.
    """
    if not protocol.takes_corrections or role == "force":
        takers = [
            f"{name}://"
            for name, module in PROTOCOLS.items()
            if _import_protocol(module).takes_corrections
        ]
        raise ConfigurationError(
            f"corrections to {address.partition('?')[0]}: only {' and '.join(takers)} robots take "
            "them.",
            hint="leave --correct out.",
        )


def _force_of_robot(
    address: str, name: str, robot: StreamSource[JointBlock] | None
) -> StreamSource[ForceBlock]:
    """The force in the messages of the robot, whose source must be the one that is meant."""
    scheme = name.partition("://")[0]
    opened = "" if robot is None else robot.health().name
    if not isinstance(robot, ForceWithJoints) or opened.partition("://")[0] != scheme:
        raise ConfigurationError(
            f"the force of {scheme}:// comes in the messages of the robot, and the robot's source "
            "is another.",
            source=address,
            hint=f"the same {scheme}:// address for --robot.",
        )
    if opened != name:
        raise ConfigurationError(
            f"force of {name}, but the robot is {opened}.",
            source=address,
            hint=f"the same {scheme}:// address for both.",
        )
    return robot.force()


def _answer(link: RobotLinkSettings, settings: SourceSettings) -> StreamSource[JointBlock]:
    """Opens a controller link that needs answers, answered by a separate process or a thread."""
    corrector = settings.corrector
    if isinstance(link, LinkSettings):
        if isinstance(corrector, RemoteGuard):
            return AnsweringLink(link, corrector)
        if corrector is None and settings.own_process and AVAILABLE:
            return AnsweringLink(link)
    if isinstance(corrector, RemoteGuard):
        raise ConfigurationError(
            f"{link.name} is answered by a thread here, but the guard runs in another process."
        )
    return link.open_link(corrector)
