"""The same report for programs: every number of the page, units in the names."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Final

from robotrue.core.files import sha256
from robotrue.report.content import Fact, ReportContent, finite_or_none

HASH: Final = "content_sha256"


def report_json(content: ReportContent) -> str:
    """Returns the report as JSON text; equal content gives equal text, NaN becomes null.

    ``content_sha256`` in it is the hash of all other values (:func:`is_intact`), inputs included:
    ``provenance`` holds theirs.
    """
    document = report_document(content)
    signed = {**document, HASH: document_sha256(document)}
    return json.dumps(signed, indent=1, allow_nan=False, ensure_ascii=False)


def content_sha256(content: ReportContent) -> str:
    """Returns the hash page, print and JSON of a report carry."""
    return document_sha256(report_document(content))


def document_sha256(document: Mapping[str, object]) -> str:
    """Returns the SHA-256 of the canonical JSON: keys sorted, no blanks, UTF-8, no hash in it."""
    bare = {key: value for key, value in document.items() if key != HASH}
    text = json.dumps(
        bare, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False
    )
    return sha256(text.encode("utf-8"))


def is_intact(document: Mapping[str, object]) -> bool:
    """Returns whether a JSON report still is what its hash was made of."""
    return document.get(HASH) == document_sha256(document)


def report_document(content: ReportContent) -> Mapping[str, object]:
    """Returns the report as JSON values without its hash; lengths in mm, angles in deg."""
    return {
        "format": "robotrue-report",
        "format_version": 1,
        "lang": content.lang,
        "title": content.title,
        "subtitle": content.subtitle,
        "simulated": content.simulated,
        "verdict": {
            "tone": content.verdict.tone,
            "text": content.verdict.text,
            "detail": content.verdict.detail,
        },
        "tiles": [
            {
                "label": tile.key or tile.label,
                "value": finite_or_none(tile.value),
                "unit": tile.unit,
                "before": finite_or_none(tile.before),
                "note": tile.note,
            }
            for tile in content.tiles
        ],
        "sections": [
            {
                "title": section.title,
                "text": section.text,
                "blocks": [block.json_block() for block in section.blocks],
            }
            for section in content.sections
        ],
        "unseen": list(content.unseen),
        "doubts": list(content.doubts),
        "provenance": _facts(content.provenance),
        **_head(content),
    }


def _head(content: ReportContent) -> Mapping[str, object]:
    """Returns the facts of the first page; the picture by its hash."""
    if not content.head:
        return {}
    head: dict[str, object] = {"head": _facts(content.head)}
    if content.signers:
        head["signers"] = _facts(content.signers)
    if content.logo:
        head["logo_sha256"] = sha256(content.logo.encode("ascii"))
    return head


def _facts(facts: tuple[Fact, ...]) -> Mapping[str, object]:
    """Values by name; several of one name as a list."""
    found: dict[str, list[str]] = {}
    for fact in facts:
        found.setdefault(fact.key or fact.name, []).append(fact.value)
    return {name: v[0] if len(v) == 1 else v for name, v in found.items()}
