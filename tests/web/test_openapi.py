"""The HTTP interface as it describes itself: asked by schemathesis, rightly and wrongly.

``ROBOTRUE_OPENAPI_EXAMPLES`` is how many requests an operation gets of each sort; ``make openapi``
asks many.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import Any, Final

import pytest

pytest.importorskip("schemathesis", reason="pip install schemathesis")

import schemathesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable
from schemathesis import APIOperation, Case, GenerationMode
from schemathesis.checks import (
    content_type_conformance,
    not_a_server_error,
    response_schema_conformance,
    status_code_conformance,
)
from web_shop import Client, Shop, fill, write_files

from robotrue.app.job_kinds import job_kinds
from robotrue.store import items, jobs
from robotrue.store.nouns import NOUNS
from robotrue.store.verify import verify

EXAMPLES: Final = int(os.environ.get("ROBOTRUE_OPENAPI_EXAMPLES", "2"))
HOST: Final = "http://127.0.0.1"
CHECKS: Final = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
SENT: Final = {
    "nothing": b"",
    "no JSON": b"{not json",
    "no text": b"\xff\xfe\x00\x80",
    "a list": b"[]",
    "a number beyond all bounds": b'{"version":1e999,"uploads":[1e999],"parameters":{"x":1e999}}',
    "NaN": b'{"name":NaN,"kind":"plan","parameters":{"x":NaN},"uploads":["0"]}',
    "NUL": b'{"name":"a\\u0000b","kind":"a\\u0000b","parameters":{"a\\u0000b":"a\\u0000b"}}',
    "half a character": b'{"name":"\\ud800","note":"\\udfff","kind":"\\ud800"}',
    "deeper than a stack": b"[" * 20_000 + b"]" * 20_000,
    "a key twice": b'{"name":"a","name":1}',
    "a key of no meaning": b'{"name":"a","Name":"b"}',
}


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    """A workspace of its own: what is asked deletes and renames, too."""
    files = tmp_path_factory.mktemp("files")
    write_files(files)
    found = fill(tmp_path_factory.mktemp("asked") / "shop", files)
    with found.workspace:
        jobs.submit(found.workspace, "calibrate", {})
        yield found


@pytest.fixture
def schema(client: Client, shop: Shop) -> Any:
    app = client(shop=shop, kinds=job_kinds()).app
    found = schemathesis.openapi.from_dict(app.openapi())
    found.app = app
    return found


def operations(schema: Any) -> list[APIOperation[Any, Any, Any, Any]]:
    return [found.ok() for found in schema.get_all_operations()]


def places(operation: APIOperation[Any, Any, Any, Any], shop: Shop) -> list[dict[str, str]]:
    """Path parameters that name something that is there."""
    known = {
        "cell": shop.cell, "measurement": shop.measured, "model": shop.model,
        "program": shop.program,
    }  # fmt: skip
    parts = operation.path.split("/")
    if "{noun}" in parts:
        digest = {k: each.attachments[0].sha256 for k, each in known.items() if each.attachments}
        return [
            {"noun": k, "id": each.id}
            | ({"sha256": digest.get(k, "0" * 64)} if "{sha256}" in parts else {})
            for k, each in known.items()
        ]
    if "{id}" not in parts:
        return []
    before = parts[parts.index("{id}") - 1]
    if before == "jobs":
        return [{"id": jobs.search(shop.workspace, limit=1).items[0].id}]
    return [{"id": known[word].id} for word in (before, before.removesuffix("s")) if word in known]


def asked(strategy: Any, label: str) -> list[str]:
    """What went wrong with the requests of a strategy."""
    wrong = []

    @given(case=strategy)
    @settings(
        max_examples=EXAMPLES,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate],
    )
    def ask(case: Case) -> None:
        answer = case.call(base_url=HOST)
        try:
            case.validate_response(answer, checks=CHECKS)
        except BaseException as fault:  # schemathesis raises groups of its own
            wrong.append(f"{label}: {answer.status_code} {str(fault)[:2000]}")

    with contextlib.suppress(Unsatisfiable):  # nothing can be wrong where all is given
        ask()
    return wrong


def test_whatever_is_asked_the_answer_is_one_that_was_announced(schema: Any, shop: Shop) -> None:
    wrong = []
    for each in operations(schema):
        for mode in GenerationMode.POSITIVE, GenerationMode.NEGATIVE:
            label = f"{each.label}, {mode.name}"
            wrong += asked(each.as_strategy(generation_mode=mode), label)
            for place in places(each, shop):
                known = each.as_strategy(generation_mode=mode, path_parameters=place)
                wrong += asked(known, f"{label}, {place}")
    assert not wrong, "\n\n".join(wrong)
    assert not verify(shop.workspace).faults
    for noun, record in (("cell", shop.cell), ("model", shop.model), ("program", shop.program)):
        first = items.get(shop.workspace, NOUNS[noun], record.id, version=1)
        assert (first.name, first.attachments) == (record.name, record.attachments)


@pytest.mark.parametrize("sent", SENT.values(), ids=SENT)
def test_bodies_of_no_form_are_refused(
    schema: Any, client: Client, shop: Shop, sent: bytes
) -> None:
    here = client(shop=shop, kinds=job_kinds())
    for each in operations(schema):
        if each.method.upper() not in ("POST", "PUT", "PATCH") or each.path == "/api/files":
            continue
        place = (places(each, shop) or [{"id": "none", "noun": "cell"}])[0]
        path = each.path.format(**place)
        if not each.body:  # nothing is read of it
            continue
        for kind in ("application/json", "text/plain", "application/x-www-form-urlencoded"):
            answer = here.request(each.method, path, content=sent, headers={"Content-Type": kind})
            assert 400 <= answer.status_code < 500, (
                each.label, kind, answer.status_code, answer.text[:500],
            )  # fmt: skip
