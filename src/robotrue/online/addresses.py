"""Address text -> source: ``rsi://``, ``egm://``, ``rtde://``, ``rdt://``, ``replay://``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, cast, overload

from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError
from robotrue.online.blocks import Block, ForceBlock, JointBlock
from robotrue.online.device_defaults import (
    EGM_PORT,
    RDT_PORT,
    RDT_SILENCE_S,
    RSI_CYCLE_MS,
    RSI_PORT,
    RTDE_PORT,
    RTDE_RATE_HZ,
    RTDE_SILENCE_S,
)
from robotrue.online.egm import RobotWare
from robotrue.online.link import Corrector, StreamSource
from robotrue.online.net_address import AddressOptions, NetAddress, net_address
from robotrue.online.rdt import RdtDevice, parse_netftapi, parse_rate
from robotrue.online.robot_correction import CorrectionMode
from robotrue.online.udp import Address

if TYPE_CHECKING:
    from robotrue.online.answering_wire import RemoteGuard
    from robotrue.online.egm_link import EgmSettings
    from robotrue.online.rsi_link import RsiSettings

Role = Literal["robot", "force"]
"""Whether joints or forces are asked of an address: RTDE, EGM and records have both."""
EXAMPLES: Final = (
    "rsi://0.0.0.0:49152?config=EthernetConfig.xml&cycle=4ms",
    "egm://0.0.0.0:6510?robotware=7",
    "rtde://192.168.0.10?rate=500Hz",
    "rdt://192.168.1.1?scale=netftapi2.xml&rate=7000Hz",
    "replay://record.csv",
)
OPTIONS: Final[Mapping[str, Mapping[str, str]]] = {
    "rsi": {
        "config": "FILE, EthernetConfig.xml of the controller",
        "cycle": "4ms or 12ms",
        "mode": "relative or absolute, as RSI_ON of the running program says",
    },
    "egm": {
        "robotware": "6 or 7",
        "mode": "absolute",
        "frame": "sensor, tool or base, axes of the measured force",
    },
    "rtde": {"rate": "packets per second in Hz, up to 500", "silence": "s"},
    "rdt": {
        "scale": "FILE or http, netftapi2.xml of the sensor",
        "rate": "records per second in Hz",
        "device": "net or axia",
        "frame": "sensor, tool or base",
        "silence": "s",
    },
    "replay": {
        "speed": "times as fast as recorded; without it as fast as it goes",
        "from": "ROW, the first that is played",
        "repeat": "how often, or forever",
        "period": "s from one repetition to the next",
        "frame": "sensor, tool or base, axes of recorded forces",
    },
}
"""What each scheme takes after ``?``, and in which unit."""
_FRAMES: Final = ("sensor", "tool", "base")
_MODES: Final = tuple(mode.value for mode in CorrectionMode)


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSettings:
    """What the service knows beyond the address.

    Attributes:
        corrector: Asked by a robot's link for each of its answers; None corrects nothing. A
            :class:`~robotrue.online.answering_wire.RemoteGuard` stands in the answering process.
        start_row: Samples a record of the service holds already; only a replay can leave them out.
        robot: The robot's source, for a force that comes in the same messages (EGM).
        own_process: Whether a process of its own answers an RSI or EGM robot, on Linux. A
            corrector that lives here is asked from a thread here, whatever this says.
        peer: Address and port of the only controller that is heard, port 0 for any of its ports.
        trust_restart: RSI: whether a Delay near zero after a pause is a session without correction.
    """

    corrector: Corrector | RemoteGuard | None = None
    start_row: int = 0
    robot: StreamSource[JointBlock] | None = None
    own_process: bool = True
    peer: Address | None = None
    trust_restart: bool = False


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
    """Returns the source of an address; robots' links listen from now on, the rest waits.

    Args:
        address: As in :data:`EXAMPLES`, with :data:`OPTIONS`.
        role: Whether joints or forces are wanted.
        settings: Of the service.

    Raises:
        ConfigurationError: An unknown scheme or option, a value that is none, a stream that the
            other side does not have, or corrections that cannot be sent there.
        FormatError: A configuration or scale that cannot be read.
    """
    settings = settings or SourceSettings()
    scheme, mark, rest = address.partition("://")
    scheme = scheme.lower()
    if scheme != "replay" and "@" in rest.partition("?")[0]:
        raise ConfigurationError(
            f"a user in the address of a {scheme} source; none of them has users.",
            hint=EXAMPLES[0],
        )
    maker = _MAKERS.get(scheme) if mark else None
    if maker is None:
        raise ConfigurationError(
            f"source {(scheme + '://') if mark else address!r}, expected one of "
            f"{', '.join(name + '://' for name in _MAKERS)}.",
            hint=EXAMPLES[0] if role == "robot" else EXAMPLES[3],
        )
    if settings.corrector is not None and (scheme not in ("rsi", "egm") or role == "force"):
        raise ConfigurationError(
            f"corrections to {scheme}://: only rsi:// and egm:// robots take them.",
            source=address,
            hint="leave --correct out.",
        )
    found = maker(address, role, settings)
    return cast("StreamSource[JointBlock] | StreamSource[ForceBlock]", found)


def _rsi(address: str, role: Role, settings: SourceSettings) -> StreamSource[Block]:
    from robotrue.online.rsi_config import read_rsi_config, usual_rsi_config
    from robotrue.online.rsi_link import RsiSettings

    where, options = _listening(address, RSI_PORT)
    _only("robot", role, address, "a KUKA controller sends no force by RSI alone")
    mode = options.word("mode", _MODES)
    path = options.text("config")
    config = usual_rsi_config(where.host, where.port, hold=mode != "relative")
    if path is not None:
        config = read_rsi_config(path)
        where, _ = _listening(address, config.port)
        if where.port not in (0, config.port):
            raise ConfigurationError(
                f"port {where.port}, but the controller sends to {config.port} by its {path}.",
                source=where.shown,
                hint=f"rsi://{where.host}:{config.port}",
            )
    return _build_answering_source(
        RsiSettings(
            name=where.shown,
            config=config,
            cycle_ms=options.whole("cycle", "ms", default=RSI_CYCLE_MS),
            mode=None if mode is None else CorrectionMode(mode),
            host=where.host,
            port=where.port,
            peer=settings.peer,
            trust_restart=settings.trust_restart,
        ),
        settings,
    )


def _egm(address: str, role: Role, settings: SourceSettings) -> StreamSource[Block]:
    from robotrue.online.answering_link import AnsweringLink
    from robotrue.online.egm_link import EgmSettings, EgmSource

    where, options = _listening(address, EGM_PORT)
    if role == "force":
        link = settings.robot
        if not (
            isinstance(link, EgmSource)
            or (isinstance(link, AnsweringLink) and isinstance(link.settings, EgmSettings))
        ):
            raise ConfigurationError(
                "the force of egm:// comes in the messages of the robot, and the robot's source "
                "is another.",
                source=address,
                hint="the same egm:// address for --robot.",
            )
        if link.settings.name != where.shown:
            raise ConfigurationError(
                f"force of {where.shown}, but the robot is {link.settings.name}.",
                hint="the same egm:// address for both.",
            )
        return link.force()
    generation = options.word("robotware", ("6", "7"))
    if generation is None:
        raise ConfigurationError(
            "RobotWare 6 or 7 is not stated, and their messages are taken for each other without "
            "an error.",
            source=address,
            hint="egm://0.0.0.0:6510?robotware=7",
        )
    mode = options.word("mode", _MODES)
    return _build_answering_source(
        EgmSettings(
            name=where.shown,
            generation=RobotWare.SIX if generation == "6" else RobotWare.SEVEN,
            mode=None if mode is None else CorrectionMode(mode),
            force_frame=options.word("frame", _FRAMES) or "sensor",
            host=where.host,
            port=where.port,
            peer=settings.peer,
        ),
        settings,
    )


def _build_answering_source(
    link: RsiSettings | EgmSettings, settings: SourceSettings
) -> StreamSource[JointBlock]:
    """The source of a controller that waits for answers: from a process of its own, or a thread."""
    from robotrue.online.answering_link import AVAILABLE, AnsweringLink
    from robotrue.online.answering_wire import RemoteGuard
    from robotrue.online.egm_link import EgmSource
    from robotrue.online.rsi_link import RsiSettings, RsiSource

    corrector = settings.corrector
    if isinstance(corrector, RemoteGuard):
        return AnsweringLink(link, corrector)
    if corrector is None and settings.own_process and AVAILABLE:
        return AnsweringLink(link)
    if isinstance(link, RsiSettings):
        return RsiSource(link, corrector)
    return EgmSource(link, corrector)


def _rtde(address: str, role: Role, settings: SourceSettings) -> StreamSource[Block]:
    from robotrue.online.rtde_link import RtdeForce, RtdeSettings, RtdeSource

    where, options = _calling(address, RTDE_PORT)
    made = RtdeSettings(
        name=where.shown,
        host=where.host,
        port=where.port,
        rate=options.number("rate", "Hz", default=RTDE_RATE_HZ),
        silence=options.number("silence", "s", default=RTDE_SILENCE_S),
    )
    return RtdeSource(made) if role == "robot" else RtdeForce(made)


def _rdt(address: str, role: Role, settings: SourceSettings) -> StreamSource[Block]:
    from robotrue.online.rdt_link import RdtSettings, RdtSource

    _only("force", role, address, "a force sensor knows no joints")
    where, options = _calling(address, RDT_PORT)
    stated = options.text("scale")
    page, scale, rate = "", None, None
    if stated == "http":
        page = f"http://{where.host}/netftapi2.xml"
    elif stated is not None and stated.startswith("http://"):
        page = stated
    elif stated is not None:
        data = read_bytes(stated)
        scale, rate = parse_netftapi(data, stated), parse_rate(data, stated)
    return RdtSource(
        RdtSettings(
            name=where.shown,
            host=where.host,
            port=where.port,
            scale=scale,
            page=page,
            device=RdtDevice(options.word("device", [d.value for d in RdtDevice]) or "net"),
            rate=options.number("rate", "Hz") if options.has("rate") else rate,
            frame=options.word("frame", _FRAMES) or "sensor",
            silence=options.number("silence", "s", default=RDT_SILENCE_S),
        )
    )


def _replay(address: str, role: Role, settings: SourceSettings) -> StreamSource[Block]:
    from robotrue.online.replay_blocks import Repeats
    from robotrue.online.replay_link import ReplayForce, ReplayJoints, ReplaySettings

    path, options = AddressOptions.of_path(address, OPTIONS["replay"])
    if not Path(path).is_file():
        raise ConfigurationError(
            f"there is no file {path!r}.", source=address, hint="replay://PATH/TO/record.csv"
        )
    forever = options.text("repeat") == "forever"
    times = None if forever else options.whole("repeat", "", default=1)
    made = ReplaySettings(
        name=f"replay://{path}",
        path=path,
        speed=options.number("speed", "") if options.has("speed") else None,
        start=options.whole("from", "", default=0) + settings.start_row,
        repeats=Repeats(
            times=times, period=options.number("period", "s") if options.has("period") else None
        ),
        frame=options.word("frame", _FRAMES) or "sensor",
    )
    return ReplayJoints(made) if role == "robot" else ReplayForce(made)


def _listening(address: str, port: int) -> tuple[NetAddress, AddressOptions]:
    """An address of our own; without a host it is all of this computer's."""
    scheme, _, rest = address.partition("://")
    if rest.startswith(":") or not rest.split("?")[0]:
        address = f"{scheme}://0.0.0.0{rest}"
    return _calling(address, port)


def _calling(address: str, port: int) -> tuple[NetAddress, AddressOptions]:
    """An address of the other side."""
    where = net_address(address, default_port=port)
    if where.path:
        raise ConfigurationError(
            f"{where.shown}: a path in the address of a {where.scheme} source.",
            hint=next(e for e in EXAMPLES if e.startswith(where.scheme)),
        )
    return where, where.read_options(OPTIONS[where.scheme])


def _only(wanted: Role, role: Role, address: str, why: str) -> None:
    if role != wanted:
        raise ConfigurationError(
            f"{why}.",
            source=address,
            hint=EXAMPLES[3] if role == "force" else EXAMPLES[0],
        )


_MAKERS: Final[Mapping[str, Callable[[str, Role, SourceSettings], StreamSource[Any]]]] = {
    "rsi": _rsi,
    "egm": _egm,
    "rtde": _rtde,
    "rdt": _rdt,
    "replay": _replay,
}
