"""The operations there are: those of the files of ``operations``, known by name and help.

Listing them imports none, so that ``robotrue --help`` answers at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from robotrue.errors import ConfigurationError

if TYPE_CHECKING:
    from robotrue.app.operation import AnyOperation

FOLDER: Final = Path(__file__).with_name("operations")
PACKAGE: Final = "robotrue.app.operations"
GROUPS: Final[Mapping[str, str]] = {
    "drill": "Square the drill to the surface with the corrected readings of a pressure foot.",
    "dynamics": "The dynamic error of milling: frequency response, force, prediction.",
    "export": "Export the calibrated robot, or points, to other software.",
    "record": "Records of the sensing service: content, streams as CSV.",
    "report": "Write reports and certificates: HTML, PDF and JSON, in English or Chinese.",
    "sense": "Sense the tool's error online; `sense CELL ...` is `sense run CELL ...`.",
    "simulate": (
        "Simulated controllers and sensors for `sense`, and a drilling head for `drill run`."
    ),
    "workspace": "Cells, measurements, models, programs and their history in one folder.",
    "jobs": "Background jobs of a workspace.",
}
"""Commands of commands in their order, with their help; a ``*_commands`` file makes those without.

``report calibration`` is the operation ``report_calibration``. One that is named as its group has
no command: ``report`` is a kind of job.
"""
OF_THE_WORKSPACE: Final = ("workspace", "jobs")
"""Groups of what is done to a workspace itself."""
_DECLARED: Final = re.compile(
    r'\n@operation\((?:"(\w+)")?[^\n]*\)\ndef (\w+)\(.*?\n    """(.+?)(?:"""|\n\n)', re.DOTALL
)
"""The name of an operation, empty where it is that of its file; its function and its docstring."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """An operation that is not imported yet.

    Attributes:
        name: Of its command with the group; also of its kind of job.
        help: One line.
        module: File that declares it.
        function: Its name there.
    """

    name: str
    help: str
    module: str = ""
    function: str = ""

    @property
    def group(self) -> str:
        """The command it is below; empty for most."""
        group = self.name.partition("_")[0]
        return group if group in GROUPS else ""

    @property
    def command(self) -> str:
        """Its name on the command line, without the group; empty for a kind of job alone."""
        return self.name.removeprefix(self.group).removeprefix("_").replace("_", "-")

    @property
    def words(self) -> str:
        """Its command with the group, as ``dynamics fit``."""
        return f"{self.group} {self.command}".strip()


@cache
def listings() -> tuple[Listing, ...]:
    """Returns all operations by name."""
    files = [path for path in FOLDER.glob("*.py") if path.stem != "__init__"]
    found = (listing for path in files for listing in _read_declarations(path))
    return tuple(sorted(found, key=lambda each: each.name))


def _read_declarations(path: Path) -> Iterator[Listing]:
    """The operations that a file declares."""
    text = path.read_text(encoding="utf-8")
    title = text.partition("\n")[0].strip('"')
    for name, function, summary in _DECLARED.findall(text):
        help = summary if name else title
        yield Listing(name=name or path.stem, help=help, module=path.stem, function=function)


@cache
def operation_of(name: str) -> AnyOperation:
    """Returns an operation, imported.

    Raises:
        ConfigurationError: There is none of that name.
    """
    listing = next((each for each in listings() if each.name == name), None)
    if listing is None:
        known = ", ".join(each.name for each in listings())
        raise ConfigurationError(f"no operation is {name!r}; there are {known}.")
    module = import_module(f"{PACKAGE}.{listing.module}")
    operation: AnyOperation = getattr(module, listing.function)
    return operation


@cache
def job_operations() -> Mapping[str, AnyOperation]:
    """Returns the operations that jobs can do, by name."""
    return {each.name: operation_of(each.name) for each in listings() if not why_no_job(each)}


def job_operation(kind: str) -> AnyOperation:
    """Returns the operation of a kind of job; no other is imported.

    Raises:
        ConfigurationError: It is no kind of job.
    """
    if kind not in {each.name for each in listings()} or why_no_job(Listing(name=kind, help="")):
        raise ConfigurationError(f"{kind!r} is no kind of job.")
    return operation_of(kind)


def why_no_job(listing: Listing) -> str:
    """Returns why no job runs an operation; empty for one that jobs can run.

    ``service``: it continues until it is stopped. ``workspace``, ``jobs``: pages and interface run
    it at once. ``machine``: it prepares this computer and has no result.
    """
    operation = operation_of(listing.name)
    if listing.group in OF_THE_WORKSPACE:
        return listing.group
    if operation.is_service:
        return "service"
    return "" if operation.has_document else "machine"
