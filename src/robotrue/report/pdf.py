"""The report as a PDF: the same content, set by typst, offline, with the fonts of the machine.

Equal content, language and fonts give equal bytes: no time and no path is written into the file.
"""

from __future__ import annotations

import base64
import json
import re
from importlib.resources import files
from types import ModuleType
from typing import Final

from robotrue.errors import ConfigurationError, MissingExtraError
from robotrue.report.content import ReportContent
from robotrue.report.figure import standalone_svg
from robotrue.report.page import page_document
from robotrue.report.theme import LIGHT
from robotrue.report.words import HTML_LANG, Lang, ReportTexts

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
"""An invisible place for a line break; a hash has none."""


def report_pdf(content: ReportContent) -> bytes:
    """Returns the report as a PDF file.

    Raises:
        MissingExtraError: typst is not installed.
        ConfigurationError: Chinese text, and no font on this machine that has it; or a damaged
            logo.
    """
    typst = _typst()
    fonts = font_families(content.lang, tuple(typst.Fonts().families()))
    template = files("robotrue.report").joinpath("page.typ").read_bytes()
    document = _HASH.sub(_breakable, json.dumps(_document(content, fonts), ensure_ascii=False))
    try:
        made = typst.compile(template, format="pdf", sys_inputs={"report": document}, timestamp=0)
    except typst.TypstError as cause:
        raise ConfigurationError(
            f"the PDF cannot be laid out: {cause}.", hint="check the logo; the HTML page may do."
        ) from cause
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


def _typst() -> ModuleType:
    try:
        import typst
    except ImportError as cause:
        raise MissingExtraError(
            "a PDF needs typst, which is not installed.", hint="pip install 'robotrue[pdf]'"
        ) from cause
    return typst


def _document(content: ReportContent, fonts: tuple[str, ...]) -> dict[str, object]:
    """Returns the template's data: the document of the page, its drawings as separate files."""
    document = page_document(content, lambda svg: standalone_svg(svg, ", ".join(fonts)))
    kind, _, logo = content.logo.partition(";base64,")
    return document | {
        "picture": list(base64.b64decode(logo)),
        "picture_format": "svg" if kind.endswith("svg+xml") else "png",
        "lang": HTML_LANG[content.lang][:2],
        "fonts": list(fonts),
        "colours": LIGHT,
        "number": ReportTexts(lang=content.lang)("page.number", page="@", pages="#"),
    }
