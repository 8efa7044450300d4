"""What a protocol of controllers or sensors says of itself: one leaf file with a ``PROTOCOL``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, Protocol, runtime_checkable

from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Block, ForceBlock, JointBlock
from robotrue.online.link import StreamSource
from robotrue.online.net_address import AddressOptions, NetAddress, net_address
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.robot_link import RobotLinkSettings
from robotrue.online.udp import Address

Role = Literal["robot", "force"]
"""Whether joints or forces are asked of an address: RTDE, EGM and records have both."""
FORCE_FRAMES: Final = ("sensor", "tool", "base")
"""Axes in which a source states forces; the value of its ``frame=``."""
CORRECTION_MODES: Final = tuple(mode.value for mode in CorrectionMode)
"""Values of ``mode=``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamSettings:
    """What the service knows of a source beyond its address.

    Attributes:
        start_row: Samples a record of the service holds already; only a replay can leave them out.
        peer: Address and port of the only controller that is heard, port 0 for any of its ports.
        trust_restart: RSI: whether a Delay near zero after a pause is a session without correction.
    """

    start_row: int = 0
    peer: Address | None = None
    trust_restart: bool = False


@runtime_checkable
class ForceWithJoints(StreamSource[JointBlock], Protocol):
    """The source of a robot whose messages also hold the measured force."""

    def force(self) -> StreamSource[ForceBlock]:
        """Returns the force as a source of its own; always one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamProtocol:
    """One protocol, named in ``addresses.PROTOCOLS``.

    Attributes:
        example: An address.
        options: What an address takes after ``?``, with the unit.
        read: Makes the source of an address, or the settings of a link that answers.
        lacks: Why one of the two streams does not come, by its role; without an entry it comes.
        takes_corrections: Whether the controller waits for answers and takes corrections.
        takes_path_axes: Whether it takes them in the axes of its path.
        link_of_force: Name of the robot's link whose messages hold the force that an address
            means; None where forces have a source of their own.
        force_rate: Force samples per second where no address states them; None: unknown.
    """

    example: str
    options: Mapping[str, str]
    read: Callable[[str, Role, StreamSettings], StreamSource[Block] | RobotLinkSettings]
    lacks: Mapping[Role, str] = field(default_factory=dict)
    takes_corrections: bool = False
    takes_path_axes: bool = False
    link_of_force: Callable[[str], str] | None = None
    force_rate: float | None = None


def read_own_address(
    address: str, port: int, options: Mapping[str, str]
) -> tuple[NetAddress, AddressOptions]:
    """Returns an address to listen at, and its options; without a host it is all of this computer.

    Raises:
        ConfigurationError: An address or option that cannot be read.
    """
    scheme, _, rest = address.partition("://")
    if rest.startswith(":") or not rest.split("?")[0]:
        address = f"{scheme}://0.0.0.0{rest}"
    return read_device_address(address, port, options)


def read_device_address(
    address: str, port: int, options: Mapping[str, str]
) -> tuple[NetAddress, AddressOptions]:
    """Returns the address of a device, and its options.

    Raises:
        ConfigurationError: An address or option that cannot be read, or a path in it.
    """
    where = net_address(address, default_port=port)
    if where.path:
        raise ConfigurationError(
            f"{where.shown}: a path in the address of a {where.scheme} source.",
            hint=f"{where.scheme}://{where.host}:{where.port}",
        )
    return where, where.read_options(options)
