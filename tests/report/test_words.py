"""Both languages say everything: the same keys, the same values in each, no key without a text."""

from __future__ import annotations

import re
import string
from pathlib import Path

import numpy as np
import pytest
from validation_fakes import FakeModel, measured

import robotrue
from robotrue.errors import ConfigurationError
from robotrue.report.calibration_report import calibration_content
from robotrue.report.words import CATALOGS, LANGUAGES, ReportTexts, in_chinese, language
from robotrue.validation.validate import validate

SOURCE = Path(robotrue.__file__).parent
CHINESE = re.compile("[\u4e00-\u9fff]")
SYMBOLS = {
    "budget.expanded",
    "distribution.repeatability",
    "reg.U",
    "plot.axis",
    "reg.subtitle",
    "cal.quarter",
}
"""Texts that are a symbol or a name in every language."""


def fields(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def used_keys() -> set[str]:
    files = [*SOURCE.glob("report/*.py"), *SOURCE.glob("cli/report_*.py")]
    known = set(CATALOGS["en"])
    prefixes = {key.partition(".")[0] for key in known if "." in key}
    found = set()
    for file in files:
        for text in re.findall(r'"((?:[a-z]+)\.[A-Za-z_0-9 ]+)"', file.read_text("utf-8")):
            if text.partition(".")[0] in prefixes:
                found.add(text)
    return found


def test_every_key_stands_in_every_language():
    for lang in LANGUAGES:
        assert set(CATALOGS[lang]) == set(CATALOGS["en"])


def test_the_same_values_are_put_into_every_language():
    for key, text in CATALOGS["en"].items():
        assert fields(CATALOGS["zh"][key]) == fields(text), key


def test_every_key_the_reports_ask_for_exists():
    keys = used_keys()
    assert len(keys) > 150
    assert keys - {"page.typ", "page.css"} <= set(CATALOGS["en"])


def test_chinese_texts_are_chinese_with_full_width_punctuation():
    for key, text in CATALOGS["zh"].items():
        if key in SYMBOLS:
            continue
        assert CHINESE.search(text), key
        bare = re.sub(r"\{[^}]*\}|ISO 9283:1998", "", text)
        assert not re.search(r"[\u4e00-\u9fff][,;:()]|[,;:()][\u4e00-\u9fff]", bare), key


def test_an_unknown_language_key_or_value_is_refused():
    with pytest.raises(ConfigurationError, match="no report language 'de'"):
        language("de")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        ReportTexts()("no.such.key")
    with pytest.raises(ConfigurationError, match="cannot be written"):
        ReportTexts()("cal.verdict", mean=1.0)


@pytest.mark.parametrize(
    "sentence",
    [
        "gear6: add poses spread further over the joint ranges and tool orientations",
        "not seen by the data: compliance1: no torque about axis 1 in these poses (gravity does "
        "not load a vertical axis); measure some poses under a known horizontal force.",
        "not seen by the data: gear5, a3 ~ a4, 3 more combinations (adds 0.012 mm to predictions "
        "inside the region of the poses): add poses spread further over the joint ranges and tool "
        "orientations.",
        "compliance4 - 1.94 compliance5: measure some poses under a known horizontal force; until "
        "then the stated stiffness is used",
        "3 of 80 rows carry no weight (row 7 first): their residual has a chance below one in a "
        "million under the fitted noise.",
        "Only 12 poses: the largest error and the coverage are not significant; at least 20 are "
        "required.",
        "A mean of 0.012 mm is below the 0.033 mm that instrument and repeatability (0.03 mm) "
        "allow for one visit per pose: averaged, simulated, or used in the fit.",
        "The stated 95 % regions hold 80.0 % of the poses (interval 66.9 to 88.8 %): the stated "
        "uncertainty is too small here.",
        "The fit used rows of the same file (a.csv sha256:ab): the numbers are valid only if "
        "these poses were held out.",
        "Axis ranges of these poses: A1 50, A2 59 deg.",
        "Temperature 19.5 to 22.1 deg C.",
    ],
)
def test_recorded_sentences_are_told_in_chinese_with_their_numbers(sentence):
    told = in_chinese(sentence)
    assert CHINESE.search(told)
    assert not re.search(r"[a-z]{2,} [a-z]{2,} [a-z]{2,}", told)
    assert set(re.findall(r"\d+\.\d+", sentence)) == set(re.findall(r"\d+\.\d+", told))


def test_pages_and_reports_spell_micrometres():
    recorded = "table E2: axis off by 351 +- 17 um and tilted by 450 +- 17 urad, 2 um/m, use_um"
    spelled = "table E2: axis off by 351 +- 17 µm and tilted by 450 +- 17 µrad, 2 µm/m, use_um"
    assert ReportTexts().sentence(recorded) == spelled


def test_a_sentence_nobody_knows_stays_as_it_is():
    assert in_chinese("Something new happened.") == "Something new happened."
    assert ReportTexts().sentence("Only 12 poses: ...") == "Only 12 poses: ..."


def test_what_a_check_doubts_and_notes_is_told_in_chinese():
    few = measured(8, error=lambda joints: np.full((len(joints), 3), 1e-3))
    report = validate(
        FakeModel(
            summary={
                "doubts": [
                    "compliance2 is negative beyond its uncertainty: check masses and loads."
                ]
            }
        ),
        few,
    )
    content = calibration_content(report, title="t", simulated=True, lang="zh")
    assert len(content.doubts) >= 3
    for sentence in (*content.doubts, *(f.value for f in content.provenance if f.key == "note")):
        assert CHINESE.search(sentence), sentence
