"""Lines with named fields: ``LIN {{X {x:.4f},Y {y:.4f}}}``.

A field is ``{name}`` or ``{name:form}``; braces that stay are doubled. A form is ``.4f`` (four
decimals), ``.9t`` (up to nine decimals, zeros at the end dropped but for one), ``d`` (a whole
number), each with ``+`` for the sign of positive numbers, ``0`` for zeros in front and a width:
``+.3f``, ``05d``. Numbers are rounded to their decimals; zero has no sign but ``+``.
"""

from __future__ import annotations

import re
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from robotrue.core.arrays import Array
from robotrue.errors import ConfigurationError

Values: TypeAlias = Mapping[str, "Array | Sequence[str] | float | str"]
"""Of the fields: one for all rows (a number or a text), or one for each row."""
_FORM: Final = re.compile(r"(?P<flags>\+?0?\d{0,2})(?:\.(?P<decimals>\d{1,2}))?(?P<kind>[dft])")
FORMS: Final = ".4f, .9t or d, with +, 0 and a width in front as in +.3f and 05d"


@dataclass(frozen=True, slots=True, kw_only=True)
class LineField:
    """One field of a template.

    Attributes:
        name: Of the value.
        kind: ``f``, ``t`` or ``d``; empty prints a text as it is.
        flags: Sign, zeros in front, width.
        decimals: Of ``f`` and ``t``.
    """

    name: str
    kind: str = ""
    flags: str = ""
    decimals: int = 0

    def print(self, values: Array) -> list[str]:
        """Returns the numbers as texts."""
        if self.kind == "d":
            return [
                f"%{self.flags}d" % value for value in np.rint(values).astype(np.int64).tolist()
            ]
        rounded = (np.round(values, self.decimals) + 0.0).tolist()
        texts = [f"%{self.flags}.{self.decimals}f" % value for value in rounded]
        return [_trim(text) for text in texts] if self.kind == "t" else texts

    def loss(self, values: Array) -> Array:
        """Returns by which share printing changes numbers above zero."""
        return np.asarray(np.abs(np.round(values, self.decimals) - values) / values)


def _trim(text: str) -> str:
    text = text.rstrip("0")
    return f"{text}0" if text.endswith(".") else text


@dataclass(frozen=True, slots=True, kw_only=True)
class LineTemplate:
    """One or more lines with fields.

    Attributes:
        parts: Text, and the field after it; None at the end.
    """

    parts: tuple[tuple[str, LineField | None], ...]

    @property
    def names(self) -> frozenset[str]:
        """Names of its fields."""
        return frozenset(field.name for field in self.fields)

    @property
    def fields(self) -> tuple[LineField, ...]:
        """Its fields, in order."""
        return tuple(field for _, field in self.parts if field is not None)

    def render(self, values: Values, count: int = 1) -> list[str]:
        """Returns the text of each of ``count`` rows.

        Raises:
            KeyError: A field has no value.
        """
        columns: list[Sequence[str]] = []
        for text, field in self.parts:
            columns.append([text] * count)
            if field is not None:
                columns.append(_print_column(field, values[field.name], count))
        return ["".join(row) for row in zip(*columns, strict=True)] if columns else [""] * count


def _print_column(
    field: LineField, value: Array | Sequence[str] | float | str, count: int
) -> Sequence[str]:
    if isinstance(value, str):
        return [value] * count
    if isinstance(value, np.ndarray):
        return field.print(value)
    if isinstance(value, Sequence):
        return value
    return field.print(np.array([value])) * count


def parse_template(text: str, numbers: frozenset[str], texts: frozenset[str]) -> LineTemplate:
    """Returns a template.

    Args:
        text: As written; one line end at its end is dropped.
        numbers: Names of fields that are numbers.
        texts: Names of fields that are texts.

    Raises:
        ConfigurationError: Braces that do not close, a field that is missing, or its form.
    """
    parts: list[tuple[str, LineField | None]] = []
    try:
        found = list(string.Formatter().parse(text.removesuffix("\n")))
    except ValueError as cause:
        raise ConfigurationError(
            f"{cause} in {text[:60]!r}.", hint="double the braces that the program has: {{ and }}."
        ) from cause
    for before, name, form, conversion in found:
        if name is None:
            parts.append((before, None))
            continue
        if name not in numbers | texts:
            raise ConfigurationError(
                f"no field {{{name}}} here; allowed are {', '.join(sorted(numbers | texts))}."
            )
        match = _FORM.fullmatch(form or "")
        wanted = "no form, it is a text" if name in texts else FORMS
        lacks = match is None or (match["kind"] == "d") != (match["decimals"] is None)
        if conversion or (lacks if name in numbers else bool(form)):
            raise ConfigurationError(f"field {{{name}}} has the form {form!r}, expected {wanted}.")
        field = LineField(name=name) if match is None else LineField(
            name=name, kind=match["kind"], flags=match["flags"],
            decimals=int(match["decimals"] or 0),
        )  # fmt: skip
        parts.append((before, field))
    return LineTemplate(parts=tuple(parts))
