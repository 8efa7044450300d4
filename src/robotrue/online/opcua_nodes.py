"""The object tree that OPC UA clients see: names, units, and the status code of a warning.

``Objects/<cell>``: ``Note``, ``Valid``, ``Doubt`` (bits), ``DoubtText``, ``Sequence``;
``Error/Ex..Ez``, ``Peak/Ex..Ez`` (largest size since the update before), ``Deviation/Ex..Ez`` (one
standard deviation), ``Static/Ex..Ez``, all um in base axes; ``Wrench/Fx..Mz`` N and N m;
``Joints/A1..`` deg as displayed; ``Health/<link>/Connected, Received, Lost, Late, Refused, Dropped,
Reconnects, TurnaroundP50, TurnaroundP99`` (ms)``, LastFault``.

The Robotics companion model comes from NodeSet files in a folder; they are the OPC Foundation's and
are not part of robotrue. Four are needed: DI, IA, Machinery, Robotics, in this order.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from asyncua import Node, Server, ua

from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.estimates import Doubt, EstimateBin

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
        folder: Folder of the node.
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


def reading_value(reading: Reading, b: EstimateBin) -> float:
    """Returns the number of a bin in the reading's unit; NaN where it is not known."""
    if reading.peak:
        return float(np.fmax(abs(b.low[reading.column]), abs(b.high[reading.column])))
    return float(b.last[reading.column])


def status_name(doubt: int, *, known: bool, whole: bool) -> str:
    """Returns the name of the OPC UA status code of a number.

    Args:
        doubt: Of its samples.
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


async def add_reading(folder: Node, index: int, name: str, unit: str) -> Node:
    """Returns a new variable of a number with its engineering unit, without a value yet."""
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


async def set_unit(node: Node, unit: str) -> None:
    """Gives a variable its engineering unit, in the codes of UNECE Recommendation 20."""
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


_MODELS: Final = tuple(
    f"http://opcfoundation.org/UA/{name}/" for name in ("DI", "IA", "Machinery", "Robotics")
)
_DI, _ROBOTICS = _MODELS[0], _MODELS[3]
_DEFINES: Final = re.compile(rb'<Model\s[^>]*ModelUri="([^"]+)"')
_SYSTEM, _DEVICE, _AXIS = "MotionDeviceSystemType", "MotionDeviceType", "AxisType"


def nodeset_files(folder: Path) -> tuple[Path, ...]:
    """Returns the files of the four models in the order of their import.

    Raises:
        ConfigurationError: One is missing, or two files define the same.
    """
    found: dict[str, list[Path]] = {uri: [] for uri in _MODELS}
    for path in sorted(folder.glob("*.xml")):
        for uri in _DEFINES.findall(read_bytes(path)[: 1 << 16]):
            if (name := uri.decode("utf-8", "replace")) in found:
                found[name].append(path)
    missing = [uri for uri, paths in found.items() if not paths]
    if missing:
        raise ConfigurationError(
            f"no NodeSet file of {', '.join(missing)}.",
            source=folder,
            hint="put the NodeSet2.xml files of DI, IA, Machinery and Robotics there.",
        )
    if twice := [uri for uri, paths in found.items() if len(paths) > 1]:
        names = ", ".join(p.name for p in found[twice[0]])
        raise ConfigurationError(f"{twice[0]} is defined by {names}, expected one.", source=folder)
    return tuple(paths[0] for paths in found.values())


async def import_models(server: Server, folder: Path) -> None:
    """Imports the four models into a server that has not been started.

    Raises:
        ConfigurationError: A file is missing.
        FormatError: A file cannot be imported.
    """
    for path in nodeset_files(folder):
        try:  # not strict: a newer file may attach nodes to ones the library does not know yet
            await server.import_xml(str(path), strict_mode=False)
        except Exception as cause:  # whatever its parsing meets
            raise FormatError(
                f"cannot be imported as a NodeSet ({type(cause).__name__}: {cause}).", source=path
            ) from cause


async def add_robot(server: Server, index: int, cell: str, joints: int) -> list[Node]:
    """Returns the ``ActualPosition`` nodes of a new robot of the companion model, A1 first.

    States that are not known here, as of safety, are left out and never claimed.

    Raises:
        FormatError: The model has not what it should have.
    """
    di, robotics = [await server.get_namespace_index(uri) for uri in (_DI, _ROBOTICS)]
    types = await _types(server, robotics)
    system = await _make_object(server.nodes.objects, index, f"{cell} robot", types[_SYSTEM])
    devices = await system.get_child([f"{robotics}:MotionDevices"])
    device = await _make_object(devices, index, "Robot", types[_DEVICE])
    axes = await device.get_child([f"{robotics}:Axes"])
    found = []
    for k in range(joints):
        axis = await _make_object(axes, index, f"Axis_{k + 1}", types[_AXIS])
        node = await axis.get_child([f"{di}:ParameterSet", f"{robotics}:ActualPosition"])
        await set_unit(node, "deg")
        await node.write_value(
            ua.DataValue(
                ua.Variant(float("nan"), ua.VariantType.Double),
                ua.StatusCode(ua.UInt32(ua.StatusCodes.BadWaitingForInitialData)),
            )
        )
        found.append(node)
    return found


async def _types(server: Server, robotics: int) -> dict[str, Node]:
    """Returns the object types of the Robotics namespace by name."""
    wanted = {_SYSTEM, _DEVICE, _AXIS}
    found: dict[str, Node] = {}
    waiting = [server.nodes.base_object_type]
    while waiting and wanted - set(found):
        node = waiting.pop()
        name = await node.read_browse_name()
        if name.NamespaceIndex == robotics and name.Name in wanted:
            found[name.Name] = node
        waiting += await node.get_children(refs=45)  # HasSubtype
    if missing := wanted - set(found):
        raise FormatError(f"the Robotics model has no {', '.join(sorted(missing))}.")
    return found


async def _make_object(parent: Node, index: int, name: str, kind: Node) -> Node:
    """Returns a new object of a type, without the placeholders its type has for a reader."""
    node = await parent.add_object(index, name, objecttype=kind.nodeid, instantiate_optional=False)
    await _without_placeholders(node)
    return node


async def _without_placeholders(node: Node) -> None:
    for child in await node.get_children():
        if (await child.read_browse_name()).Name.startswith("<"):
            await child.delete(delete_references=True, recursive=True)
        else:
            await _without_placeholders(child)
