"""The report as a PDF: the same content, set by typst, offline, with the fonts of the machine.

Equal content, language and fonts give equal bytes: no time and no path is written into the file.
"""

from __future__ import annotations

import json
import re
from importlib.resources import files
from typing import Any, Final

from robotrue.core.provenance import simulation_mark
from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.report.blocks import draw_block
from robotrue.report.content import Block, ReportContent, Table
from robotrue.report.figure import standalone_svg
from robotrue.report.json import content_sha256
from robotrue.report.page import WIDE, cell_text, is_words
from robotrue.report.theme import LIGHT
from robotrue.report.words import HTML_LANG, Lang, Words

LATIN: Final = ("DejaVu Sans", "Liberation Sans", "Arial", "Helvetica", "Libertinus Serif")
"""Of the machine, best first; the last one comes with typst."""
CHINESE: Final = (
    "Noto Sans CJK SC",
    "Noto Sans SC",
    "Source Han Sans SC",
    "Source Han Sans CN",
    "PingFang SC",
    "Microsoft YaHei",
    "WenQuanYi Micro Hei",
    "WenQuanYi Zen Hei",
    "Droid Sans Fallback",
    "SimHei",
    "SimSun",
)
FONT_PACKAGE: Final = "fonts-noto-cjk"
_HASH: Final = re.compile(r"\b[0-9a-f]{17,}\b")
_PIECE: Final = 8
_BREAK: Final = "\u200b"
"""A place where a line may end that prints nothing; a hash has none of its own."""


def report_pdf(content: ReportContent) -> bytes:
    """Returns the report as a PDF file.

    Raises:
        MissingExtraError: typst is not installed.
        ConfigurationError: Chinese text, and no font on this machine that has it.
    """
    typst = _typst()
    fonts = font_families(content.lang, tuple(typst.Fonts().families()))
    template = files("robotrue.report").joinpath("page.typ").read_bytes()
    document = _HASH.sub(_breakable, json.dumps(_document(content, fonts), ensure_ascii=False))
    made = typst.compile(template, format="pdf", sys_inputs={"report": document}, timestamp=0)
    return bytes(made)


def font_families(lang: Lang, installed: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the families to set a language in, best first.

    Args:
        lang: Of the report.
        installed: Families of this machine and of typst.

    Raises:
        ConfigurationError: Chinese, and none of :data:`CHINESE` is there.
    """
    latin = tuple(name for name in LATIN if name in installed)[:1]
    if lang == "en":
        return latin
    chinese = tuple(name for name in CHINESE if name in installed)[:1]
    if not chinese:
        raise ConfigurationError(
            "no font with Chinese characters on this machine: the PDF would print boxes.",
            hint=f"apt-get install {FONT_PACKAGE}; the HTML page needs no font here.",
        )
    return (*latin, *chinese)


def _breakable(found: re.Match[str]) -> str:
    text = found.group()
    return _BREAK.join(text[k : k + _PIECE] for k in range(0, len(text), _PIECE))


def _typst() -> Any:
    try:
        import typst
    except ImportError as cause:
        raise MissingExtraError(
            "a PDF needs typst, which is not installed.", hint="pip install 'robotrue[pdf]'"
        ) from cause
    return typst


def _document(content: ReportContent, fonts: tuple[str, ...]) -> dict[str, Any]:
    """What the template prints, every number already in words."""
    words = Words(lang=content.lang)
    footer = words("page.footer")
    footer += simulation_mark(content.simulated, f" {words('page.footer_simulated')}")
    return {
        "lang": HTML_LANG[content.lang][:2],
        "fonts": list(fonts),
        "colours": LIGHT,
        "title": content.title,
        "subtitle": content.subtitle,
        "simulated": simulation_mark(content.simulated, words("page.simulated")),
        "verdict": {
            "text": content.verdict.text,
            "detail": content.verdict.detail,
            "colour": "after" if content.verdict.tone == "plain" else content.verdict.tone,
        },
        "tiles": [
            {
                "label": tile.label,
                "value": f"{tile.value:.{tile.digits}f}",
                "unit": tile.unit,
                "before": ""
                if tile.before is None
                else words(
                    "page.before", value=f"{tile.before:.{tile.digits}f} {tile.unit}".strip()
                ),
                "note": tile.note,
                "colour": "ink" if tile.tone == "plain" else tile.tone,
            }
            for tile in content.tiles
        ],
        "sections": [
            {
                "title": section.title,
                "text": section.text,
                "blocks": [
                    _block(block, f"s{i}b{k}", words, fonts)
                    for k, block in enumerate(section.blocks)
                ],
            }
            for i, section in enumerate(content.sections)
        ],
        "lists": [
            {"title": title, "items": list(items)}
            for title, items in (
                (words("page.unseen"), content.unseen),
                (words("page.doubts"), content.doubts),
            )
            if items
        ],
        "provenance": {
            "title": words("page.provenance"),
            "facts": [[fact.name, fact.value] for fact in content.provenance],
        },
        "footer": footer,
        "hash": words("page.hash", hash=content_sha256(content)),
        "number": words("page.number", page="@", pages="#"),
    }


def _block(block: Block, key: str, words: Words, fonts: tuple[str, ...]) -> dict[str, Any]:
    head: dict[str, Any] = {"title": block.title, "caption": block.caption, "svg": "", "table": []}
    if not isinstance(block, Table):
        return head | {"svg": standalone_svg(draw_block(block, key, words), ", ".join(fonts))}
    wordy = [is_words(block, index) for index in range(len(block.columns))]
    return head | {
        "columns": [
            {"title": column.title, "unit": column.unit, "words": left}
            for column, left in zip(block.columns, wordy, strict=True)
        ],
        "table": [
            [cell_text(cell, column) for cell, column in zip(row, block.columns, strict=True)]
            for row in block.rows
        ],
        "highlight": -1 if block.highlight is None else block.highlight,
        "wide": len(block.columns) > WIDE,
    }
