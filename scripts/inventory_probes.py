"""Where each feature of the product can be seen: one probe for each section of the inventory.

A probe asks the running package (the command line, the HTTP application, the registries), not its
files, so that moving code does not move the inventory. Where a registry itself moves, its probe
moves in the same commit; the lines that it yields stay.
"""

from __future__ import annotations

import ast
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[1]
SOURCE: Final = ROOT / "src" / "robotrue"
_MARK: Final = re.compile(r"""data-testid=\\?["']?([A-Za-z][\w-]*)(?![\w{-])""")
_FIELD: Final = re.compile(
    r"""<(?:input|select|textarea)\b[^<>]*?\bname=\\?["']([A-Za-z]\w*(?:\[\])?)["']"""
)


def commands() -> Iterator[str]:
    """Yields every command, and every argument and option with its form and its default."""
    import typer

    from robotrue.cli.main import app

    yield from _command(typer.main.get_command(app), "robotrue")


def _command(command: Any, name: str) -> Iterator[str]:
    yield name
    place = 0
    for parameter in command.params:
        flag = getattr(parameter, "is_flag", False)
        option = parameter.opts[0].startswith("-")
        place += not option
        spelled = sorted(parameter.opts, reverse=True) + sorted(parameter.secondary_opts)
        facts = [
            " ".join(spelled) if option else f"argument {place}",
            "flag" if flag else parameter.metavar or _type_name(parameter),
            "required" if parameter.required else f"= {_plain(parameter.default)}",
            "repeated" if parameter.nargs != 1 or getattr(parameter, "multiple", False) else "",
            f"env {parameter.envvar}" if parameter.envvar else "",
            "hidden" if getattr(parameter, "hidden", False) else "",
        ]
        yield f"{name} {' '.join(filter(None, facts))}"
    for word, below in sorted(getattr(command, "commands", {}).items()):
        yield from _command(below, f"{name} {word}")


def _type_name(parameter: Any) -> str:
    """The type of a value; older typer says it as click does, newer by the annotation."""
    descriptor = getattr(parameter, "type_descriptor", None)
    named: str = descriptor.annotation.__name__ if descriptor else parameter.type.name
    return {"str": "text", "int": "integer", "Path": "path", "bool": "boolean"}.get(named, named)


def _plain(value: Any) -> str:
    value = getattr(value, "value", value)
    return (
        "none"
        if value in (None, [], ())
        else str(value)
        if isinstance(value, Path)
        else repr(value)
    )


def routes() -> Iterator[str]:
    """Yields the addresses the workbench answers: pages, HTTP interface, files."""
    yield from sorted(set(_routes(_application().routes)))


def _routes(found: Any, before: str = "") -> Iterator[str]:
    for route in found:
        included = getattr(route, "original_router", None)
        if included is not None:  # as newer FastAPI keeps what include_router was given
            yield from _routes(included.routes, before + route.include_context.prefix)
            continue
        path = before + route.path
        if "/_nicegui" in path:
            continue
        if hasattr(route, "methods"):
            for method in sorted((route.methods or set()) - {"HEAD"}):
                yield f"{method} {path or '/'}"
        elif getattr(route, "routes", None):
            yield from _routes(route.routes, path)
        elif hasattr(route, "endpoint"):
            yield f"WEBSOCKET {path}"
        else:
            yield f"FILES {path}"


_APPLICATIONS: Final[list[Any]] = []


def _application() -> Any:
    """The application of ``robotrue serve`` on a new workspace; nothing is started."""
    if not _APPLICATIONS:
        from robotrue.app.job_kinds import job_kinds
        from robotrue.web.serve_settings import ServeSettings
        from robotrue.web.server import core_app, open_workspace, server_context

        around = tempfile.TemporaryDirectory(prefix="robotrue-inventory-")
        folder = Path(around.name) / "workspace"
        settings = ServeSettings(workspace=folder, port=0, kinds=job_kinds())
        context = server_context(settings, open_workspace(folder))
        _APPLICATIONS.extend((core_app(context), around))
    return _APPLICATIONS[0]


def operations() -> Iterator[str]:
    """Yields the operations of the HTTP interface, their parameters, bodies and answers."""
    schema = _application().openapi()
    for path, methods in schema["paths"].items():
        for method, operation in methods.items():
            name = f"{method.upper()} {path}"
            yield name
            for one in operation.get("parameters", []):
                yield f"{name} {one['in']} {one['name']}"
            for kind, body in operation.get("requestBody", {}).get("content", {}).items():
                yield from (f"{name} body {kind} {each}" for each in _fields(body, schema))
            for kind, body in operation["responses"].get("200", {}).get("content", {}).items():
                yield from (f"{name} answer {kind} {each}" for each in _fields(body, schema))


def _fields(holder: Mapping[str, Any], schema: Mapping[str, Any]) -> list[str]:
    """The fields of a body, those of its objects behind a dot."""
    return sorted(_below(holder.get("schema", {}), schema, "", ())) or ["(any)"]


def _below(
    part: Mapping[str, Any], schema: Mapping[str, Any], name: str, inside: tuple[str, ...]
) -> set[str]:
    reference = part.get("$ref", "")
    if reference:
        if reference in inside:
            return {name}
        named = schema
        for step in reference.removeprefix("#/").split("/"):
            named = named[step]
        return _below(named, schema, name, (*inside, reference))
    found: set[str] = set()
    for choice in (*part.get("anyOf", ()), *part.get("oneOf", ()), *part.get("allOf", ())):
        found |= _below(choice, schema, name, inside)
    if isinstance(part.get("items"), Mapping):
        found |= _below(part["items"], schema, f"{name}[]", inside)
    for key, value in part.get("properties", {}).items():
        found |= _below(value, schema, f"{name}.{key}".lstrip("."), inside) or set()
    return found or ({name} if name else set())


def pages() -> Iterator[str]:
    """Yields marks of pages and names of form fields that the workbench spells out."""
    for text in texts():
        yield from (f"mark {mark}" for mark in _MARK.findall(text))
        yield from (f"field {field}" for field in _FIELD.findall(text))


def texts() -> Iterator[str]:
    """Yields the text of every file of the package that can hold a page."""
    for path in sorted(SOURCE.rglob("*")):
        if path.suffix in (".py", ".html", ".js", ".jinja", ".toml") and path.is_file():
            yield path.read_text(encoding="utf-8")


def jobs() -> Iterator[str]:
    """Yields the kinds of jobs, and each parameter with its type and default."""
    from robotrue.app.registry import job_operations
    from robotrue.app.request import NAMED

    for kind, operation in job_operations().items():
        yield kind
        yield from (f"{kind} {each}: text" for each in NAMED)
        yield from (f"{kind} {each}" for each in _stated(operation))


def _stated(operation: Any) -> Iterator[str]:
    """The parameters of a job that is made from a request."""
    from robotrue.app.job_files import job_fields, result_name
    from robotrue.app.request import JOB, InputFile, Item, Output

    types = {bool: "flag", int: "whole", float: "number"}
    for field in job_fields(operation):
        if isinstance(field.entry, InputFile):
            form = "files" if field.many else "file" if field.is_required(JOB) else "file_or_none"
            yield f"{field.name}: {form}"
        elif isinstance(field.entry, Output) and operation.save is None:
            usual = result_name(operation.request, field)
            yield f"{field.name}: result" + (f" = {usual!r}" if field.required else "_or_none")
        elif isinstance(field.entry, Item):
            form = (
                "items"
                if field.many_in_jobs or field.entry.listed
                else "item"
                if field.is_required(JOB)
                else "item_or_none"
            )
            yield f"{field.name}: {form} {field.entry.noun}"
        elif isinstance(field.entry, Output):
            yield f"{field.name}: flag = False"
        elif field.many:
            yield f"{field.name}: texts"
        else:
            form = types.get(field.kind, "text")
            usual = "_or_none" if field.default is None else f" = {field.default!r}"
            yield f"{field.name}: {form}" + ("" if field.is_required(JOB) else usual)


def _value(node: ast.expr, module: Any) -> Any:
    return getattr(module, node.id) if isinstance(node, ast.Name) else ast.literal_eval(node)


def program_formats() -> Iterator[str]:
    """Yields the dialects, their suffixes, who can insert targets, frame files, and the posts."""
    from robotrue.program.lang import languages
    from robotrue.program.posts import read_posts

    for name, language in sorted(languages().items()):
        yield f"{name}: {' '.join(sorted(language.suffixes))}"
        if language.inserter:
            yield f"{name} inserts targets"
        if language.frame_files:
            yield from (f"{name} frames {file}" for file in language.frame_files.names)
    for name, post in sorted(read_posts().items()):
        yield f"post {name}: {' '.join(sorted(post.stated.suffixes))}"


def measurement_formats() -> Iterator[str]:
    """Yields layouts of measurement files, and what a mapping can say."""
    from dataclasses import fields

    from robotrue.measurement.formats.mapping import ColumnMapping, read_layouts

    yield from (f"layout {name}" for name in ("canonical", *read_layouts()))
    yield from (f"mapping {each.name}: {each.type}" for each in fields(ColumnMapping))


def dynamics_formats() -> Iterator[str]:
    """Yields suffixes of frequency responses and of force records."""
    from robotrue.dynamics.cutter import KINDS
    from robotrue.dynamics.formats.frf_table import FRF_SUFFIXES
    from robotrue.dynamics.formats.signal_table import SIGNAL_SUFFIXES

    yield from (f"frequency response {each}" for each in FRF_SUFFIXES)
    yield from (f"force record {each}" for each in SIGNAL_SUFFIXES)
    yield from (f"cutter {each}" for each in KINDS)


def reports() -> Iterator[str]:
    """Yields subjects, forms and languages of reports, and the languages of the workbench."""
    from robotrue.app.operations.report import FORMS, SUBJECTS
    from robotrue.report.words import CATALOGS

    yield from (f"subject {each}" for each in SUBJECTS)
    yield from (f"form {each}" for each in FORMS)
    yield from (f"language {each}" for each in CATALOGS)
    yield from (f"workbench language {each.name}" for each in _folders(SOURCE / "web/languages"))


def _folders(folder: Path) -> Iterator[Path]:
    return (each for each in folder.iterdir() if each.is_dir() and not each.name.startswith("_"))


def models() -> Iterator[str]:
    """Yields calibration methods, kinds of archives, and parts of drilling models."""
    from robotrue.calibration.archive import KINDS
    from robotrue.calibration.methods import METHODS
    from robotrue.drilling.correction_trials import KINDS as DRILLING

    yield from (f"method {each}" for each in METHODS)
    yield from (f"archive {each}" for each in KINDS)
    yield from (f"drilling {each}" for each in DRILLING)


def online() -> Iterator[str]:
    """Yields schemes of sources with their options, and of sinks."""
    from robotrue.online.addresses import PROTOCOLS, protocol_of
    from robotrue.online.sinks import EXAMPLES

    for scheme in PROTOCOLS:
        yield f"source {scheme}"
        yield from (f"source {scheme} {each}" for each in protocol_of(f"{scheme}://").options)
    yield from (f"sink {example.partition(':')[0]}" for example in EXAMPLES)


def presets() -> Iterator[str]:
    """Yields the names of robots."""
    from robotrue.robot.presets import preset_names

    yield from preset_names()


def store() -> Iterator[str]:
    """Yields nouns of the workspace, and what exports say they cannot."""
    from robotrue.app.operations.exports import ExportRequest
    from robotrue.app.outputs import FORMATS
    from robotrue.app.request import fields_of
    from robotrue.report import export_controller, export_description, export_ur
    from robotrue.store.nouns import NOUNS

    yield from (f"noun {each}" for each in NOUNS)
    for name, parts in (
        ("controller", export_controller.CANNOT),
        ("dh", export_description.DH_CANNOT),
        ("ur", export_ur.CANNOT),
        ("urdf", export_description.URDF_CANNOT),
    ):
        yield from (f"export {name} without {part}" for part in parts)
    (place,) = [each for each in fields_of(ExportRequest) if each.name == "at"]
    yield from (f"export at {each}" for each in place.choices)
    yield from (f"output {suffix}" for suffix in FORMATS)


def simulation() -> Iterator[str]:
    """Yields scenarios, faults that simulators make, and reproduced papers with their tables."""
    from robotrue.simulation.online_faults import FAULTS as WIRE
    from robotrue.simulation.rdt_sensor import FAULTS as SENSOR
    from robotrue_reproductions.deng2022.scenarios import SCENARIOS
    from robotrue_reproductions.papers import PAPERS

    yield from (f"scenario {each}" for each in SCENARIOS)
    for name, faults in (("rdt", SENSOR), ("rtde", WIRE), ("rsi, egm", WIRE)):
        yield from (f"fault {name} {getattr(each, 'value', each)}" for each in faults)
    for name, paper in PAPERS.items():
        yield f"paper {name}"
        yield from (f"paper {name} table {table}" for table in paper.tables)


def cell_file() -> Iterator[str]:
    """Yields the keys of ``cell.toml``."""
    from robotrue.cell.schema import CellFile

    schema = CellFile.model_json_schema()
    yield from sorted(_below(schema, schema, "", ()))


def errors() -> Iterator[str]:
    """Yields the kinds of errors with their exit codes."""
    from robotrue import errors as module

    for name, kind in vars(module).items():
        if isinstance(kind, type) and issubclass(kind, module.RobotrueError):
            yield f"{name} exit {kind.exit_code}"


PROBES: Final[Mapping[str, Callable[[], Iterator[str]]]] = {
    "command": commands,
    "route": routes,
    "operation": operations,
    "page": pages,
    "job": jobs,
    "program": program_formats,
    "measurement": measurement_formats,
    "dynamics": dynamics_formats,
    "report": reports,
    "model": models,
    "online": online,
    "robot": presets,
    "store": store,
    "simulation": simulation,
    "cell.toml": cell_file,
    "error": errors,
}
"""Sections of the inventory, each line begins with the name of its own."""
