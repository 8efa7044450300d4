"""Documentation against the product: links, commands, options, presets, columns, keys."""

from __future__ import annotations

import functools
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
import typer.main

from robotrue.calibration.methods import METHODS
from robotrue.cell.schema import CellFile
from robotrue.cli.main import app
from robotrue.compensation.status import Status
from robotrue.measurement.formats.canonical import canonical_mapping
from robotrue.measurement.formats.mapping import ColumnMapping, read_layouts
from robotrue.robot.presets import preset, preset_names

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CONVENTIONS.md", "CHANGELOG.md"))]
    + [p for p in (ROOT / "docs").rglob("*.md") if "_build" not in p.parts]
)
LINK = re.compile(r"!?\[[^\]\n]*\]\(([^)\s]+)\)")
CALL = re.compile(
    r"robotrue (demo|plan|calibrate-lengths|calibrate|transfer|validate|predict|program|compensate|"
    r"diff|inspect|map|wrap|"
    r"register|report|export|drift-plan|drift|probe-plan|slot-test|reproduce|dynamics|drill|simulate|workspace|jobs)"
    r"\b([^\n`|]*)"
)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")


def page_id(page: Path) -> str:
    return str(page.relative_to(ROOT))


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@functools.cache
def known_options() -> dict[str, frozenset[str]]:
    root = typer.main.get_command(app)
    found = {}
    for name, command in root.commands.items():  # type: ignore[attr-defined]
        parts = [command, *getattr(command, "commands", {}).values()]
        params = [p for part in parts for p in part.params]
        words = {o for p in params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
        found[name] = frozenset(word for word in words if word.startswith("-"))
    return found


def headings(text: str) -> Iterator[str]:
    for line in re.findall(r"^#{1,6} +(.+)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", line.lower()).strip().replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_relative_links_resolve(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page_id(page)} links to {target}"
        if anchor:
            assert anchor in set(headings(file.read_text(encoding="utf-8"))), target


def test_every_page_is_in_a_table_of_contents() -> None:
    listed = set()
    for page in PAGES:
        for tree in re.findall(r"```\{toctree\}(.*?)```", page.read_text(encoding="utf-8"), re.S):
            names = [line for line in tree.split() if not line.startswith(":")]
            listed |= {(page.parent / f"{name}.md").resolve() for name in names}
    missing = [
        page_id(p)
        for p in PAGES
        if "docs" in p.relative_to(ROOT).parts and p.name != "index.md" and p not in listed
    ]
    assert not missing


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_options_named_in_a_command_exist(page: Path) -> None:
    options = known_options()
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    for command, rest in CALL.findall(text):
        for option in OPTION.findall(rest):
            assert option in options[command], f"{page_id(page)}: robotrue {command} {option}"


def test_the_reference_names_every_command_and_option() -> None:
    sections = re.split(r"^## ", read("docs/reference/cli.md"), flags=re.MULTILINE)
    by_name = {section.split("\n", 1)[0].strip(): section for section in sections[1:]}
    options = known_options()
    assert set(by_name) == set(options)
    for command, names in options.items():
        for option in names - {"--help"}:
            assert option in by_name[command], f"{command} {option} is not in the reference"


def test_the_reference_names_every_method_and_status() -> None:
    text = read("docs/reference/cli.md")
    for name in (*METHODS, "auto", *(s.name.lower() for s in Status)):
        assert f"`{name}`" in text, name


def test_the_table_of_robots_is_complete() -> None:
    rows = re.findall(r"^\| `([^`]+)` \|(.*)$", read("docs/reference/robots.md"), re.MULTILINE)
    assert tuple(name for name, _ in rows) == preset_names()
    for name, rest in rows:
        robot = preset(name)
        cells = [cell.strip() for cell in rest.split("|")]
        assert cells[2].startswith("none") == (not robot.link_mass.any()), name
        controller = robot.controller
        assert controller is not None
        assert cells[3].startswith("A = -q") == bool((controller.sign < 0.0).any()), name


def test_the_reference_names_every_column_of_the_csv() -> None:
    text = read("docs/reference/measurement-csv.md")
    mapping = canonical_mapping(2)
    for column in mapping.columns():
        assert re.search(rf"\b{column}\b", text), column


def test_the_how_to_names_every_field_of_a_mapping_and_every_layout() -> None:
    text = read("docs/howto/import-a-tracker-file.md")
    for name in [f.name for f in fields(ColumnMapping) if f.name != "name"] + list(read_layouts()):
        assert f"`{name}`" in text, name


def test_the_reference_names_every_key_of_the_cell_file() -> None:
    text = read("docs/reference/cell-toml.md")
    for table, field in CellFile.model_fields.items():
        if table == "schema_":
            continue
        assert f"[{table}]" in text, table
        inner = field.annotation
        for kind in (inner, *getattr(inner, "__args__", ())):
            for key in getattr(kind, "model_fields", {}):
                assert f"`{key}`" in text, f"{table}.{key}"


def test_the_answers_of_every_page_are_run() -> None:
    """A page with a console block is named by the test that runs it."""
    here = Path(__file__).parent
    tests = "".join(
        each.read_text(encoding="utf-8")
        for each in here.glob("test_*pages.py")
        if "check_answers" in each.read_text()
    )
    pages = [page for page in PAGES if "```console" in page.read_text(encoding="utf-8")]
    assert [p.stem for p in pages if f'"{p.stem}"' not in tests and p.parent.name != "zh"] == []


def test_no_page_holds_a_path_of_somebody_s_machine() -> None:
    for page in PAGES:
        found = re.search(r"/(root|home|work|tmp)/", page.read_text(encoding="utf-8"))
        assert found is None, f"{page_id(page)}: {found}"


def test_the_made_parts_of_the_reference_are_current() -> None:
    found = subprocess.run(  # noqa: S603
        [sys.executable, str(ROOT / "docs/make_reference.py"), "--check"],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert found.returncode == 0, found.stderr
