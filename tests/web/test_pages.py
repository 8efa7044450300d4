"""Every page and every part of one in both languages without a browser, and what they may run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from web_shop import Client, Shop

from robotrue.store.workspace import Workspace
from robotrue.web.language import LANGUAGES
from robotrue.web.pages import SCREENS


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_page_and_part_is_built(client: Client, filled: Shop, language: str) -> None:
    here = client()
    addresses = {screen.path for screen in SCREENS}
    addresses |= {
        f"/cell?cell={filled.cell.id}",
        f"/?cell={filled.cell.id}",
        f"/?cell={filled.cell.id}&edit=1",
        "/?new=1",
    }
    addresses |= {"/drilling?view=model", "/drilling?view=monitor", "/history?offset=1"}
    for path, id, parts in (
        ("/measurements", filled.measured.id, ("", "judged", "rows")),
        ("/programs", filled.program.id, ("", "judged", "changes")),
    ):
        addresses |= {f"{path}?id={id}&part={part}" for part in parts}
    addresses |= {
        f"/calibration?model={filled.model.id}&part={part}" for part in ("learned", "residuals")
    }
    for address in sorted(addresses):
        answer = here.get(address, headers={"accept-language": language})
        assert answer.status_code == 200, address
        assert 'data-testid="fault"' not in answer.text, address
        if "part=" not in address or address.endswith("part="):
            assert f'<html lang="{language}">' in answer.text, address
        assert not re.search(r"<script(?! src=| type=)|\son\w+=", answer.text), address


def test_a_project_shows_its_stages_and_the_next_step(client: Client, tmp_path: Path) -> None:
    """An empty one teaches; the practice project makes cell and poses, which say what they are."""
    english = {"accept-language": "en"}
    with Workspace.create(tmp_path / "shop") as workspace:
        here = client(workspace=workspace)
        page = here.get("/", headers=english).text
        assert 'href="/cell?new=1">Create a cell' in page
        assert page.count("stage done") == 0
        for path in ("/plan", "/measurements", "/calibration", "/registration", "/drift"):
            assert 'data-testid="needs"' in here.get(path).text, path
        assert here.post("/api/sample-project", json={}).status_code == 201
        page = here.get("/", headers=english).text
        assert page.count("stage done") == 2
        assert 'href="/calibration">Calibrate' in page
        assert "Add the practice cell" not in page
        poses = here.get("/measurements", headers=english).text
        assert poses.count('class="simulated"') == 2
        form = here.get("/calibration", headers=english).text
        assert form.count(" checked") == 1  # the set that was imported last


def test_a_finished_project_offers_the_next_program(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = ("setup", "measure", "calibrate", "use", "monitor")
    monkeypatch.setattr("robotrue.web.server.count_items", lambda _: dict.fromkeys(names, 2))
    page = client().get("/", headers={"accept-language": "en"}).text
    assert page.count("stage done") + page.count("stage next done") == 5
    assert page.count('data-testid="next-step"') == 1
    assert 'href="/programs">Compensate a program' in page


def test_hashes_of_a_set_are_closed(client: Client, filled: Shop) -> None:
    page = client().get(f"/measurements?id={filled.measured.id}").text
    closed = page.partition('<details class="card more" data-testid="provenance">')[2]
    assert filled.measured.data in closed.partition("</details>")[0]
    assert page.count(filled.measured.data) == 1


def test_what_is_not_there_is_said_on_the_page(client: Client) -> None:
    here = client()
    for path in ("/measurements?id=nothing", "/programs?id=nothing", "/drift?id=nothing"):
        answer = here.get(path, headers={"accept-language": "en"})
        assert "Page not found." in answer.text
        assert "nothing" in answer.text
    missing = here.get("/nowhere", headers={"accept": "text/html"})
    assert missing.status_code == 404
    assert missing.headers["content-type"].startswith("text/html")
    assert here.get("/nowhere").json()["status"] == 404
    dark = {"accept": "text/html", "cookie": "robotrue_view=theme=dark"}
    assert 'data-theme="dark"' in here.get("/nowhere", headers=dark).text
    assert "part=nothing" not in here.get("/programs?part=nothing").text


def test_pages_run_no_script_but_their_own_files(client: Client) -> None:
    policy = client().get("/programs").headers["content-security-policy"]
    (scripts,) = [each for each in policy.split("; ") if each.startswith("script-src")]
    assert scripts == "script-src 'self' 'unsafe-eval'"
