"""Every text in every language, with the same values to put in; and what people choose."""

from __future__ import annotations

import re
from pathlib import Path
from string import Formatter

import numpy as np
import pytest
from web_shop import unpacked

from robotrue.app.workbench.arm_body import orientations
from robotrue.core.rotations import (
    matrix_from_abc,
    matrix_from_quat_wxyz,
    matrix_from_rotation_vector,
)
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.web import pages
from robotrue.web.language import LANGUAGES, Wording, choose_language, words
from robotrue.web.preferences import ANGLE_NAMES, CHOICES, preferences_from
from robotrue.web.templating import ICONS

ROOM = Path(pages.__file__).parents[1]
USED = re.compile(r"""say\(\s*f?["']([a-z_]+\.[a-z_]+)["'](?!\s*~)""")


def values_of(text: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(text) if name}


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_language_has_every_text_with_the_same_values(language: str) -> None:
    english, other = words("en"), words(language)
    assert set(other) == set(english)
    for key, text in other.items():
        assert text.strip(), key
        assert values_of(text) == values_of(english[key]), key


def test_every_text_that_is_said_is_there() -> None:
    known = words("en")
    for path in (*ROOM.rglob("*.py"), *ROOM.rglob("*.html")):
        for key in USED.findall(path.read_text()):
            assert key in known, f"{path.name}: {key}"


def test_chinese_is_chinese() -> None:
    same = {k for k, v in words("zh").items() if v == words("en")[k] and re.search("[a-z]{4}", v)}
    assert not same


def test_a_text_that_is_not_there_is_said_so() -> None:
    with pytest.raises(ConfigurationError, match=r"no text 'cell\.nothing' in languages/en"):
        Wording("en")("cell.nothing")


def test_pages_have_names_icons_and_addresses_of_their_own() -> None:
    assert len({page.path for page in pages.SCREENS}) == len(pages.SCREENS)
    for page in pages.SCREENS:
        assert f"nav.{page.name}" in words("en")
        assert page.name in ICONS


@pytest.mark.parametrize(
    ("asked", "language"),
    [("zh-CN,zh;q=0.9,en;q=0.8", "zh"), ("de,en;q=0.5", "en"), ("", "en"), ("en-US,zh", "en")],
)
def test_the_browser_s_language_is_taken(asked: str, language: str) -> None:
    assert choose_language(asked) == language


def test_choices_come_from_the_cookie_and_nothing_else_does() -> None:
    cookie = {"robotrue_view": "language=zh&theme=dark&angles=abb&unit=um&admin=1"}
    chosen = preferences_from(cookie, "en")
    assert (chosen.language, chosen.theme, chosen.angles, chosen.unit) == (
        "zh",
        "dark",
        "abb",
        "um",
    )
    encoded = {"robotrue_view": "language%3Dzh%26unit%3Dum"}
    assert preferences_from(encoded).language == "zh"
    odd = preferences_from({"robotrue_view": "language=<script>&theme=&unit=inch"}, "zh")
    assert (odd.language, odd.theme, odd.unit) == ("zh", "auto", "mm")


def test_errors_and_orientations_are_printed_as_chosen() -> None:
    rotation = matrix_from_abc(np.array([[10.0, 20.0, 30.0]]) * DEG)
    found = {name: unpacked(each)[0] for name, each in orientations(rotation).items()}
    assert set(found) == set(CHOICES["angles"])
    np.testing.assert_allclose(found["kuka"], [10.0, 20.0, 30.0], rtol=1e-6)
    np.testing.assert_allclose(found["fanuc"], [30.0, 20.0, 10.0], rtol=1e-6)
    np.testing.assert_allclose(matrix_from_quat_wxyz(found["abb"]), rotation[0], atol=1e-6)
    np.testing.assert_allclose(matrix_from_rotation_vector(found["ur"]), rotation[0], atol=1e-6)
    assert {name: len(letters) for name, letters in ANGLE_NAMES.items()} == {
        name: len(numbers) for name, numbers in found.items()
    }
    assert preferences_from({}).error(1.234e-4) == "0.123"
    assert preferences_from({"robotrue_view": "unit=um"}).error(1.234e-4) == "123"
