"""Addresses of scripts and styles: new ones for a new content, kept by the browser until then."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from web_shop import Client

from robotrue.web.static_files import LIVE, OWN, STAMP, STATIC_ROOT, hash_files


def test_a_browser_keeps_the_files_of_this_release(client: Client) -> None:
    here = client()
    page = here.get("/live").text
    named = re.findall(r'(?:href|src)="(/static/[^"]+)"', page)
    assert len(named) >= 6
    modules = ("components/scene.js", "vue/vue.esm-browser.prod.js", "three/index.js")
    for address in (*named, *(f"{STATIC_ROOT}/{each}" for each in (*modules, "live/plot.js"))):
        answer = here.get(address)
        assert address.startswith(STATIC_ROOT + "/")
        assert (answer.status_code, "immutable" in answer.headers["cache-control"]) == (200, True)


def test_a_page_of_another_release_finds_files_that_are_not_kept(client: Client) -> None:
    answer = client().get("/static/0123456789abcdef/bench.js")
    assert answer.status_code == 200
    assert answer.headers["cache-control"] == "no-store"


def test_a_changed_script_changes_every_address(tmp_path: Path) -> None:
    copied = shutil.copytree(OWN, tmp_path / "static")
    assert hash_files(copied, LIVE) == STAMP
    (copied / "bench.js").write_text("// new")
    assert hash_files(copied, LIVE) != STAMP


def test_scripts_import_by_relative_addresses() -> None:
    scripts = [path for folder in (OWN, LIVE) for path in folder.rglob("*.js")]
    assert len(scripts) > 20
    for script in scripts:
        text = script.read_text(encoding="utf-8")
        for address in re.findall(
            r"""^(?:import .*from |.*await import\()["`]([^"`]+)""", text, re.M
        ):
            assert address.startswith((".", "${this.files}/")), (script.name, address)
