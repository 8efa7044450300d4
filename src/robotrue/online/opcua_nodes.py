"""The object tree that OPC UA clients see: names, units, and how a doubt becomes a status code.

``Objects/<cell>``: ``Note``, ``Valid``, ``Doubt`` (bits), ``DoubtText``, ``Sequence``;
``Error/Ex..Ez``, ``Peak/Ex..Ez`` (largest size since the update before), ``Deviation/Ex..Ez`` (one
standard deviation), ``Static/Ex..Ez``, all um in base axes; ``Wrench/Fx..Mz`` N and N m;
``Joints/A1..`` deg as displayed; ``Health/<link>/Connected, Received, Lost, Late, Refused, Dropped,
Reconnects, TurnaroundP50, TurnaroundP99`` (ms)``, LastFault``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from robotrue.online.envelopes import Bin
from robotrue.online.estimates import Doubt

URI: Final = "urn:robotrue:online"
_UNITS: Final = {
    "um": ("4H", "micrometre"),
    "N": ("NEW", "newton"),
    "N·m": ("NU", "newton metre"),
    "deg": ("DD", "degree [unit of angle]"),
    "ms": ("C26", "millisecond"),
}
"""Our unit -> (UNECE common code, its name)."""
_ANALOG_UNIT_TYPE: Final = 17497
_AXES: Final = ("Ex", "Ey", "Ez")
COUNTERS: Final = ("received", "lost", "late", "refused", "dropped", "reconnects")


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """One number of the tree.

    Attributes:
        folder: It stands in.
        name: Of the variable.
        unit: A key of the units.
        column: Among the numbers of a bin.
        peak: Whether the largest size of the bin is meant and not its last value.
    """

    folder: str
    name: str
    unit: str
    column: int
    peak: bool = False


def readings(joints: int) -> tuple[Reading, ...]:
    """Returns every number of the tree of an arm."""
    blocks = (("Error", 0, False), ("Peak", 0, True), ("Deviation", 3, False), ("Static", 6, False))
    found = [
        Reading(folder=folder, name=axis, unit="um", column=start + k, peak=peak)
        for folder, start, peak in blocks
        for k, axis in enumerate(_AXES)
    ]
    for k, name in enumerate(("Fx", "Fy", "Fz", "Mx", "My", "Mz")):
        unit = "N" if k < 3 else "N·m"
        found.append(Reading(folder="Wrench", name=name, unit=unit, column=9 + k))
    for k in range(joints):
        found.append(Reading(folder="Joints", name=f"A{k + 1}", unit="deg", column=15 + k))
    return tuple(found)


def reading_value(reading: Reading, b: Bin) -> float:
    """Returns the number of a bin in the reading's unit; NaN where it is not known."""
    if reading.peak:
        return float(np.fmax(abs(b.low[reading.column]), abs(b.high[reading.column])))
    return float(b.last[reading.column])


def status_name(doubt: int, *, known: bool, whole: bool) -> str:
    """Returns the name of the OPC UA status code of a number.

    Args:
        doubt: Of the samples it stands for.
        known: Whether there is a number at all.
        whole: Whether none of these samples was invalid.
    """
    if known:
        if doubt & Doubt.EXTRAPOLATED or not whole:
            return "UncertainSubNormal"
        return "Good"
    for bit, name in (
        (Doubt.BAD_FORCE | Doubt.BAD_JOINTS, "BadSensorFailure"),
        (Doubt.NO_JOINTS, "BadNoData"),
        (Doubt.OUTSIDE, "BadOutOfRange"),
        (Doubt.CLOCK, "BadInvalidTimestamp"),
        (Doubt.SETTLING, "BadWaitingForInitialData"),
    ):
        if doubt & bit:
            return name
    return "BadNoData"


async def add_reading(folder: Any, index: int, name: str, unit: str) -> Any:
    """Returns a new variable of a number with its engineering unit, without a value yet."""
    from asyncua import ua

    empty = ua.DataValue(
        ua.Variant(float("nan"), ua.VariantType.Double),
        ua.StatusCode(ua.UInt32(ua.StatusCodes.BadWaitingForInitialData)),
    )
    node = await folder.add_variable(index, name, float("nan"), ua.VariantType.Double)
    await set_unit(node, unit)
    await node.delete_reference(
        ua.NodeId(ua.ObjectIds.BaseDataVariableType), ua.ObjectIds.HasTypeDefinition, True, False
    )
    await node.add_reference(
        ua.NodeId(_ANALOG_UNIT_TYPE), ua.ObjectIds.HasTypeDefinition, True, False
    )
    await node.write_value(empty)
    return node


async def set_unit(node: Any, unit: str) -> None:
    """Gives a variable its engineering unit, in the codes of UNECE Recommendation 20."""
    from asyncua import ua

    code, words = _UNITS[unit]
    information = ua.EUInformation(
        NamespaceUri="http://www.opcfoundation.org/UA/units/un/cefact",
        UnitId=int.from_bytes(code.encode("ascii"), "big"),
        DisplayName=ua.LocalizedText(unit),
        Description=ua.LocalizedText(words),
    )
    for child in await node.get_children():
        if (await child.read_browse_name()).Name == "EngineeringUnits":
            await child.write_value(information)
            return
    await node.add_property(0, "EngineeringUnits", information)
