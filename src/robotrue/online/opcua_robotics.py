"""The Robotics companion model: its NodeSet files from a folder, its robot with joints.

The files are the OPC Foundation's and are not part of robotrue. Four are needed: DI, IA,
Machinery, Robotics, in this order.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

from robotrue.core.files import read_bytes
from robotrue.errors import ConfigurationError, FormatError
from robotrue.online.opcua_nodes import set_unit

_MODELS: Final = tuple(
    f"http://opcfoundation.org/UA/{name}/" for name in ("DI", "IA", "Machinery", "Robotics")
)
_DI, _ROBOTICS = _MODELS[0], _MODELS[3]
_DEFINES: Final = re.compile(rb'<Model\s[^>]*ModelUri="([^"]+)"')
_SYSTEM, _DEVICE, _AXIS = "MotionDeviceSystemType", "MotionDeviceType", "AxisType"


def nodeset_files(folder: Path) -> tuple[Path, ...]:
    """Returns the files of the four models in the order of their import.

    Raises:
        ConfigurationError: One is not there, or two files define the same.
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


async def import_models(server: Any, folder: Path) -> None:
    """Imports the four models into a server that has not been started.

    Raises:
        ConfigurationError: A file is missing.
        FormatError: A file cannot be imported.
    """
    for path in nodeset_files(folder):
        try:  # not strict: a newer file may hang nodes on ones the library does not know yet
            await server.import_xml(str(path), strict_mode=False)
        except Exception as cause:  # whatever its parsing meets
            raise FormatError(
                f"cannot be imported as a NodeSet ({type(cause).__name__}: {cause}).", source=path
            ) from cause


async def add_robot(server: Any, index: int, cell: str, joints: int) -> list[Any]:
    """Returns the ``ActualPosition`` nodes of a new robot of the companion model, A1 first.

    States that are not known here, as of safety, are left out and never claimed.

    Raises:
        FormatError: The model has not what it should have.
    """
    from asyncua import ua

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


async def _types(server: Any, robotics: int) -> dict[str, Any]:
    """Returns the object types of the Robotics namespace by name."""
    wanted = {_SYSTEM, _DEVICE, _AXIS}
    found: dict[str, Any] = {}
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


async def _make_object(parent: Any, index: int, name: str, kind: Any) -> Any:
    """Returns a new object of a type, without the placeholders its type has for a reader."""
    node = await parent.add_object(index, name, objecttype=kind.nodeid, instantiate_optional=False)
    await _without_placeholders(node)
    return node


async def _without_placeholders(node: Any) -> None:
    for child in await node.get_children():
        if (await child.read_browse_name()).Name.startswith("<"):
            await child.delete(delete_references=True, recursive=True)
        else:
            await _without_placeholders(child)
