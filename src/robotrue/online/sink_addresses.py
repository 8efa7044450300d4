"""Address text -> sink: ``csv:PATH``, ``mqtt://``, ``opcua://``, ``ws://``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from robotrue.errors import ConfigurationError
from robotrue.online.link import Sink
from robotrue.online.net_address import NetAddress, net_address
from robotrue.online.sink_settings import SinkSettings, require_library

EXAMPLES: Final = (
    "csv:out.csv",
    "csv+append:out.csv",
    "mqtt://broker:1883/robotrue/cell-3",
    "mqtts://broker:8883/robotrue/cell-3",
    "opcua://127.0.0.1:4840",
    "ws://127.0.0.1:8765",
)


def open_sink(address: str, settings: SinkSettings | None = None) -> Sink:
    """Returns the sink of an address, not opened yet.

    Args:
        address: As in :data:`EXAMPLES`.
        settings: Of the service.

    Raises:
        ConfigurationError: An unknown scheme, or an address that is not whole or not safe.
        MissingExtraError: The library of this sink is not installed.
    """
    settings = settings or SinkSettings()
    scheme, colon, rest = address.partition(":")
    scheme = scheme.lower()
    if colon and scheme in ("csv", "csv+append"):
        return _csv(rest, replace(settings, resume=settings.resume or scheme == "csv+append"))
    maker = _SERVERS.get(scheme) if colon else None
    if maker is None:
        raise ConfigurationError(
            f"sink {(scheme + ':' if colon else address)!r}, expected one of csv:, csv+append:, "
            f"{', '.join(s + '://' for s in _SERVERS)}.",
            hint=", ".join(EXAMPLES[:1] + EXAMPLES[2:3] + EXAMPLES[4:]),
        )
    return maker(net_address(address, default_port=_PORTS[scheme]), settings)


def _csv(path: str, settings: SinkSettings) -> Sink:
    from robotrue.online.csv_sink import CsvSink

    path = path.removeprefix("//")
    if not path:
        raise ConfigurationError("a csv address without a path.", hint=EXAMPLES[0])
    return CsvSink(path, settings)


def _mqtt(address: NetAddress, settings: SinkSettings) -> Sink:
    require_library("aiomqtt", "mqtt")
    from robotrue.online.mqtt_sink import MqttSink

    return MqttSink(address, settings)


def _opcua(address: NetAddress, settings: SinkSettings) -> Sink:
    require_library("asyncua", "opcua")
    from robotrue.online.opcua_sink import OpcUaSink

    return OpcUaSink(address, settings)


def _ws(address: NetAddress, settings: SinkSettings) -> Sink:
    require_library("websockets", "ws")
    from robotrue.online.ws_sink import WebSocketSink

    return WebSocketSink(address, settings)


_SERVERS: Final[dict[str, Callable[[NetAddress, SinkSettings], Sink]]] = {
    "mqtt": _mqtt,
    "mqtts": _mqtt,
    "opcua": _opcua,
    "ws": _ws,
}
_PORTS: Final = {"mqtt": 1883, "mqtts": 8883, "opcua": 4840, "ws": 8765}
