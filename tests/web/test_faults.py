"""Refusals in the reader's language around what was said in English; steps of jobs likewise."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from robotrue import errors, web
from robotrue.app.job_kinds import job_kinds
from robotrue.app.registry import job_operations
from robotrue.calibration.methods import METHODS
from robotrue.errors import FormatError, RobotrueError
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.report.words import in_chinese
from robotrue.validation.splits import SplitKind
from robotrue.web.language import Wording
from robotrue.web.pages.history_screen import kind_name
from robotrue.web.problems import KINDS, MissingError, fault_card, refusal, title_of
from robotrue.web.workers import Unanswered


def test_every_error_has_a_name_in_every_language() -> None:
    ours = [e for e in vars(errors).values() if isinstance(e, type) and e is not RobotrueError]
    raised = [e("no") for e in ours if issubclass(e, RobotrueError)]
    assert len(raised) == 12
    for each in (*raised, MissingError("no"), Unanswered("no")):
        assert title_of(each) in KINDS


@pytest.mark.parametrize("language", ["en", "zh"])
def test_every_kind_says_what_helps(language: str) -> None:
    for kind in KINDS:
        assert "<b>" in fault_card(Wording(language), kind, "x", None)


def test_a_chinese_page_frames_what_is_said_in_english() -> None:
    error = FormatError("<b>1 row</b>", source="/home/x/part.src", line=7, hint="export it.")
    english, chinese = (refusal(Wording(each), error) for each in ("en", "zh"))
    assert "<b>Format error</b> part.src:7: &lt;b&gt;1 row&lt;/b&gt;" in english
    assert "<b>格式错误</b> 文件格式与预期不符" in chinese
    assert '<span lang="en">part.src:7: &lt;b&gt;1 row&lt;/b&gt;</span>' in chinese
    assert '<span lang="en">export it.</span>' in chinese
    assert "/home" not in english + chinese
    assert "<b>未找到。</b>" in fault_card(Wording("zh"), "odd", "x", None, title="未找到。")


def test_what_is_to_be_typed_as_a_command_is_no_help_on_a_page() -> None:
    for hint in ("--name", "robotrue workspace undo 12ab"):
        assert hint not in fault_card(Wording("en"), "configuration error", "no name.", hint)
    hint = "pip install 'robotrue[pdf]'"
    kept = fault_card(Wording("en"), "missing extra error", "no typst.", hint)
    assert "pip install" in kept


def test_what_a_calibration_is_at_is_told_in_the_reader_s_words() -> None:
    for step in (*METHODS, *get_args(SplitKind), "chosen"):
        assert Wording("zh").has(f"step.{step}"), step


def test_history_names_every_kind_of_job_and_what_happens_to_one() -> None:
    say = Wording("zh")
    saved = {kind for kind, each in job_operations().items() if each.save is not None}
    assert all(say.has(f"history.kind_{kind}") for kind in saved)
    assert {kind_name(say, kind) for kind in set(job_kinds()) - saved} >= {
        "dynamics fit",
        "predict",
    }
    happens = (
        "submitted",
        "begun",
        "done",
        "failed",
        "cancelled",
        "cancel_asked",
        "discarded",
        "died",
        "imported",
    )
    assert all(say.has(f"history.action_{action}") for action in happens)
    assert all(say.has(f"calibration.model_{method}") for method in METHODS)
    cure = "not seen by the data: gear5: measure some poses under a known horizontal force, or "
    assert not set("measure") & set(in_chinese(cure + "state the stiffness.").partition("gear5")[2])


def test_no_page_opens_a_window_of_the_browser_to_say_something() -> None:
    room = Path(web.__file__).parent
    for path in (*room.rglob("*.js"), *room.rglob("*.py"), *room.rglob("*.html")):
        assert "alert(" not in path.read_text(), path.name


def test_a_picture_is_no_table(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\r\n1,2\n")
    with pytest.raises(FormatError, match="holds zero bytes"):
        read_sheet(path)
