"""The package in ``examples/extension`` as if it were installed."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robotrue.calibration.terms import term_registry
from robotrue.measurement.formats.mapping import read_layouts
from robotrue.program.posts import read_posts
from robotrue.robot import presets

PACKAGE = Path(__file__).resolve().parents[1] / "examples" / "extension"
SOURCE = PACKAGE / "src"
sys.path.append(str(SOURCE))

from robotrue_example.warm_drives import USUAL, WarmDrives  # noqa: E402

__all__ = ["USUAL", "WarmDrives", "installed_example"]


def forget_extensions() -> None:
    """Makes the registries ask for entry points again."""
    term_registry.unregister(WarmDrives.name)
    term_registry.load_outside.cache_clear()
    presets.read_preset_tables.cache_clear()
    read_layouts.cache_clear()
    read_posts.cache_clear()


@contextmanager
def installed_example(site: Path) -> Iterator[None]:
    """Puts the metadata of the package into a folder of the path, without a network."""
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())["project"]
    info = site / f"robotrue_example-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (info / "entry_points.txt").write_text("\n".join([*lines, ""]))
    sys.path.insert(0, str(site))
    forget_extensions()
    try:
        yield
    finally:
        sys.path.remove(str(site))
        forget_extensions()
