"""Simulated controllers and sensors: the fields they share, their start, running until Ctrl-C.

All of them live through the same cycle at the same time, so that a robot and a sensor started in
two terminals belong together.
"""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Final, TypeAlias, TypeVar, cast

from robotrue.app.context import Context
from robotrue.app.presentation import Facts, PlainResult
from robotrue.app.request import Option
from robotrue.errors import ConfigurationError
from robotrue.simulation.device_defaults import LOCAL_HOST

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from robotrue.simulation.online_faults import Fault
    from robotrue.simulation.online_scenario import OnlineScenario

T = TypeVar("T")
V = TypeVar("V")

Host: TypeAlias = Annotated[str, Option(help="Own address; 0.0.0.0 accepts other computers.")]
Target: TypeAlias = Annotated[str, Option(help="Destination computer.")]
Seconds: TypeAlias = Annotated[float | None, Option(help="Run time in s; default: until Ctrl-C.")]
Seed: TypeAlias = Annotated[int, Option(help="Seed of cutter and noise.")]
Robot: TypeAlias = Annotated[
    str | None,
    Option(help=("Preset: KR160, UR10; default: the arm of the virtual milling experiment.")),
]
Faults: TypeAlias = Annotated[
    tuple[str, ...],
    Option(
        names=("--fault",),
        help=("Fault as KIND@START_S+DURATION_S; may be repeated; a wrong KIND lists all."),
    ),
]
LABELS: Final[Mapping[str, str]] = {
    "largest_mm": "largest correction, mm",
    "largest_step_mm": "largest step of it, mm",
    "correction": "correction at the end, mm and deg",
    "offset": "offset at the end, mm",
    "left_out": "left out, this computer was busy",
    "withheld": "withheld by a fault",
    "late": "late",
    "overslept": "of these, in cycles the simulator cut short",
    "broke_off": "broke off",
    "stopped": "stopped",
    "moved": "holes moved for",
    "tilt_before_mean_deg": "true tilt before, mean deg",
    "tilt_left_mean_deg": "true tilt left, mean deg",
    "tilt_left_max_deg": "true tilt left, largest deg",
    "without_answer": "without an answer",
}


def announce(what: str, scenario: OnlineScenario, option: str, context: Context) -> None:
    """Reports what is simulated and how ``robotrue sense`` reaches it."""
    from robotrue.simulation.online_scenario import CYCLE, KNOCKS, PASS

    context.inform(f"SIMULATED {what}; {scenario.robot.name}, cutter of seed {scenario.seed}.")
    context.inform(
        f"simulated: {len(KNOCKS)} knocks from {KNOCKS[0]:g} s, a milling pass from {PASS[0]:g} to "
        f"{PASS[1]:g} s, then back; again every {CYCLE:g} s."
    )
    context.inform(f"robotrue sense CELL ... {option}")
    context.inform("Ctrl-C ends it.")


def run_until_stopped(
    what: str,
    run: Callable[[asyncio.Event], Awaitable[object]],
    *,
    seconds: float | None,
) -> PlainResult:
    """Runs until Ctrl-C, its own end or that of the time; returns its report.

    Args:
        what: Is simulated.
        run: Runs until the event is set; returns a dataclass.
        seconds: After which it is stopped; None for never.

    Raises:
        ConfigurationError: No time at all.
    """
    from robotrue.online.udp import prompt_answers

    if seconds is not None and not seconds > 0.0:
        raise ConfigurationError(f"{seconds:g} seconds, expected more than none.")
    begun = time.monotonic()
    # a controller's clock does not wait, and these sleep most of the time
    with prompt_answers(first=True):
        report = asyncio.run(_stoppable(run, seconds))
    took = time.monotonic() - begun
    figures = {
        name: _json_value(name, value)
        for name, value in asdict(cast("DataclassInstance", report)).items()
    }
    rows = ((LABELS.get(name, name), _text(value)) for name, value in figures.items())
    return PlainResult(
        values={"simulated": what, "seconds": took, **figures},
        shown=(Facts(title=f"SIMULATED {what}", rows=(("ran", f"{took:.1f} s"), *rows)),),
    )


async def _stoppable(run: Callable[[asyncio.Event], Awaitable[T]], seconds: float | None) -> T:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    if seconds is not None:
        loop.call_later(seconds, stop.set)

    def request_stop(*_: object) -> None:
        loop.call_soon_threadsafe(stop.set)

    before = signal.signal(signal.SIGINT, request_stop)
    try:
        return await run(stop)
    finally:
        signal.signal(signal.SIGINT, before)


def choose(text: str, known: Mapping[str, V], what: str) -> V:
    """Returns the value that a word names.

    Raises:
        ConfigurationError: Another word.
    """
    if text not in known:
        raise ConfigurationError(f"{what} {text!r}, expected {' or '.join(known)}.")
    return known[text]


def controller_faults(stated: Sequence[str]) -> tuple[Fault, ...]:
    """Returns the faults of a simulated controller.

    Raises:
        ConfigurationError: Text that states none.
    """
    from robotrue.simulation.online_faults import FAULTS, parse_fault

    return tuple(parse_fault(text, FAULTS) for text in stated)


def free_port() -> int:
    """Returns a UDP port that is free here: a receiver for the controller can bind it."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        trial.bind(("", 0))
        return int(trial.getsockname()[1])


def reachable_host(host: str) -> str:
    """Returns the address under which a client on this computer reaches a server."""
    return LOCAL_HOST if host == "0.0.0.0" else host  # noqa: S104


def _json_value(name: str, value: object) -> object:
    import numpy as np

    from robotrue.core.units import MM

    if name == "offset":
        value = np.asarray(value) / MM
    return value.tolist() if isinstance(value, np.ndarray) else value


def _text(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(f"{v:.4f}" for v in value)
    if isinstance(value, float):
        return f"{value:.4f}"
    return "no" if value in ("", None) else str(value)
