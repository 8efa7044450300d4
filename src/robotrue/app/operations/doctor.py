"""Check the installation: libraries, extras, compiled kernels, fonts, the workbench's port."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Facts, Note, PlainResult, Table
from robotrue.app.request import Request
from robotrue.app.serve_defaults import HOST, PORT
from robotrue.errors import ConfigurationError
from robotrue.version import __version__

if TYPE_CHECKING:
    from packaging.requirements import Requirement

EXTRAS: Final[Mapping[str, str]] = {
    "web": "serve: the workbench",
    "store": "workspace, jobs",
    "postgres": "workspaces in PostgreSQL",
    "online": "sense: MQTT, OPC UA, WebSocket",
    "dynamics": "dynamics: UFF and TDMS files",
    "pdf": "reports as PDF",
    "mesh": "part meshes other than STL",
    "dask": "compensate on several machines",
}
"""What each optional group of libraries is for, as ``pip install 'robotrue[NAME]'`` spells it."""


class DoctorRequest(Request):
    """Nothing: the whole installation is checked."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Library:
    """A library this installation needs, or could use.

    Attributes:
        name: As the package index spells it.
        version: That is installed; None for none.
        wanted: Versions that are enough, as ``>=2.0``.
        fits: Whether the installed one is among them.
    """

    name: str
    version: str | None
    wanted: str
    fits: bool

    def __str__(self) -> str:
        return f"{self.name} {self.version or 'missing'}" + (
            f" ({self.wanted} needed)" if self.version and not self.fits else ""
        )


@operation()
def run(request: DoctorRequest, context: Context) -> PlainResult:
    """Changes nothing on this computer; every fault comes with its cure."""
    import platform

    needed, extras = _libraries()
    cache, compiled, writable = _kernel_cache()
    port = _port_fault()
    fonts = _chinese_font()
    faults = [f"{lib}. Try: pip install 'robotrue'" for lib in needed if not lib.fits]
    if not writable:
        faults.append(
            f"kernels cannot be saved in {cache}: each run compiles them again. Try: "
            "NUMBA_CACHE_DIR=a folder you may write."
        )
    extra_rows = tuple(
        (name, EXTRAS[name], ", ".join(map(str, lacks)) or "installed")
        for name, lacks in extras.items()
    )
    facts = (
        ("robotrue", __version__),
        ("Python", f"{platform.python_version()}, {platform.system()} {platform.machine()}"),
        ("executable", sys.executable),
        ("libraries", ", ".join(map(str, needed))),
        ("kernels", f"saved in {cache}" if compiled else "compiled at first use"),
        ("port of the workbench", port or "free"),
        ("Chinese in PDF", fonts or "no font with Chinese characters"),
    )
    return PlainResult(
        values={
            "version": __version__,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            "libraries": {lib.name: lib.version for lib in needed},
            "extras": {name: not lacks for name, lacks in extras.items()},
            "lacking": {name: [x.name for x in lacks] for name, lacks in extras.items() if lacks},
            "kernel_cache": cache,
            "kernels_compiled": compiled > 0,
            "kernel_cache_writable": writable,
            "port_fault": port,
            "chinese_font": fonts,
            "faults": faults,
        },
        shown=(
            Facts(title="installation", rows=facts),
            Table(
                title="extras: pip install 'robotrue[NAME]', or all but postgres: 'robotrue[all]'",
                columns=("name", "for", "state"),
                rows=extra_rows,
                words=True,
            ),
            Note("ready" if not faults else f"{len(faults)} to fix"),
            *map(Note, faults),
        ),
    )


def _libraries() -> tuple[list[_Library], dict[str, list[_Library]]]:
    """Returns the required libraries, and for each extra those that are missing."""
    from importlib.metadata import requires

    from packaging.requirements import Requirement

    stated = [Requirement(line) for line in requires("robotrue") or ()]
    needed = [_look_up(each) for each in stated if _applies(each, "")]
    extras = {
        name: [lib for lib in map(_look_up, _of_extra(stated, name)) if not lib.fits]
        for name in EXTRAS
    }
    return needed, extras


def _of_extra(stated: Sequence[Requirement], extra: str) -> list[Requirement]:
    """Requirements of an extra alone; those of an extra it names are that one's."""
    return [
        each
        for each in stated
        if _applies(each, extra) and not _applies(each, "") and each.name != "robotrue"
    ]


def _applies(requirement: Requirement, extra: str) -> bool:
    return requirement.marker is None or requirement.marker.evaluate({"extra": extra})


def _look_up(requirement: Requirement) -> _Library:
    from importlib.metadata import PackageNotFoundError, version

    try:
        found = version(requirement.name)
    except PackageNotFoundError:
        found = None
    return _Library(
        name=requirement.name,
        version=found,
        wanted=str(requirement.specifier),
        fits=found is not None and requirement.specifier.contains(found, prereleases=True),
    )


def _kernel_cache() -> tuple[str, int, bool]:
    """Returns the folder of the compiled kernels, their number, and whether it can be written."""
    from robotrue.compensation import inversion_kernels

    kernels = [
        cache
        for kernel in vars(inversion_kernels).values()
        if (cache := getattr(kernel, "_cache", None)) is not None and hasattr(cache, "cache_path")
    ]
    if not kernels:
        return "memory alone", 0, False
    folder = Path(kernels[0].cache_path)
    nearest = next(path for path in (folder, *folder.parents) if path.exists())
    return str(folder), len(list(folder.glob("*.nbi"))), os.access(nearest, os.W_OK)


def _port_fault() -> str:
    """Why the workbench could not open its usual port; empty if it could."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        try:
            probe.bind((HOST, PORT))
        except OSError as cause:
            return f"{HOST}:{PORT} is taken ({cause.strerror}): robotrue serve --port {PORT + 1}"
    return ""


def _chinese_font() -> str:
    """A font of this computer that reports in Chinese can be printed with; empty for none."""
    from robotrue.report.pdf import font_families

    try:
        import typst
    except ImportError:
        return "needs the extra pdf"
    try:
        return font_families("zh", tuple(typst.Fonts().families()))[-1]
    except ConfigurationError:
        return ""
