"""Forms made from requests: defaults, limits and texts come from the request and the languages."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import pytest

from robotrue.app.operations.calibrate import CalibrateRequest
from robotrue.app.operations.drift_checks import DriftPlanRequest, DriftRequest
from robotrue.app.operations.report import SUBJECTS, ReportRequest
from robotrue.app.plan_request import PlanRequest
from robotrue.app.request import FORM, Request, fields_of
from robotrue.web.language import LANGUAGES, Wording
from robotrue.web.parts.request_form import RequestForm


@dataclass(frozen=True)
class Reader:
    """What a form needs of a page."""

    say: Any


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    ("request_type", "group", "without"),
    [
        (PlanRequest, "plan", {"region", "program", "within"}),
        (CalibrateRequest, "calibration", set()),
        (DriftPlanRequest, "drift", {"model", "seed"}),
        (DriftRequest, "drift", {"model", "level"}),
        (ReportRequest, "reports", {*SUBJECTS, "lang", "strict", "forms"}),
    ],
)
def test_every_field_of_a_form_has_its_default_and_its_words(
    language: str, request_type: type[Request], group: str, without: set[str]
) -> None:
    context: Any = Reader(say=Wording(language))
    form = RequestForm(
        context=context,
        request=request_type,
        group=group,
        records={},
        without=frozenset(without),
    )
    shown = form.fields(advanced=False) + form.fields(advanced=True)
    if context.say.has(f"{group}.name"):
        shown += form.name_field()
    for field in fields_of(request_type):
        if not field.is_in(FORM) or field.name in form.without or field.many:
            continue
        assert f'name="{field.name}"' in shown.replace("'", '"')
        if field.kind in (int, float):
            (value,) = re.findall(rf'name="{field.name}" value="([^"]*)"', shown)
            assert (float(value) if value else None) == field.default
        if field.choices:
            selected = re.search(rf'name="{field.name}".*?value="([^"]*)" selected', shown)
            assert selected is not None
            assert selected[1] == field.default
