"""Fields of forms, made from the request of an operation.

Labels come from the languages: ``<group>.<field>``, its choices ``<group>.<field>_<choice>``, the
text of an item that may be left out ``<group>.<field>_none``, a hint ``<group>.<field>_hint``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from annotated_types import Ge, Gt, Le, Lt
from markupsafe import Markup

from robotrue.app.request import (
    FORM,
    JOB,
    InputFile,
    Item,
    Output,
    Request,
    RequestField,
    fields_of,
)
from robotrue.store.records import ItemRecord
from robotrue.web.page_context import PageContext
from robotrue.web.templating import macro

TEMPLATE = "request_form.html"
_OPTION: Final = re.compile(r"--[a-z][a-z0-9-]*")


def name_options(
    stated: object, fields: Iterable[RequestField], words: Callable[[str], str]
) -> object:
    """Returns a text, or JSON values with texts, with labels of fields in place of options.

    Args:
        stated: As the command states it.
        fields: Of the form; options of others stay.
        words: The label of a field.
    """
    labels = {each.option: words(each.name) for each in fields}

    def reword(value: object) -> object:
        if isinstance(value, str):
            return _OPTION.sub(lambda o: f"“{labels[o[0]]}”" if o[0] in labels else o[0], value)
        if isinstance(value, Mapping):
            return {key: reword(each) for key, each in value.items()}
        return [reword(each) for each in value] if isinstance(value, list | tuple) else value

    return reword(stated)


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestForm:
    """Fields of a request's form for one reader.

    Attributes:
        context: Of the page.
        request: Type of the request.
        group: Of the texts.
        records: Items to choose from, by noun.
        marks: ``data-testid`` of fields, by field; ``name`` for the name of the result.
        without: Fields that the page builds itself.
        values: Initial value of a field instead of its default; it cannot be cleared.
    """

    context: PageContext
    request: type[Request]
    group: str
    records: Mapping[str, Sequence[ItemRecord]] = field(default_factory=dict)
    marks: Mapping[str, str] = field(default_factory=dict)
    without: frozenset[str] = frozenset()
    values: Mapping[str, object] = field(default_factory=dict)

    def fields(self, *, advanced: bool) -> Markup:
        """Returns the HTML of the fields in sight, or of those behind "more"."""
        return Markup().join(
            self.control(each)
            for each in fields_of(self.request)
            if each.is_in(FORM)
            and each.entry.advanced is advanced
            and each.name not in self.without
        )

    def name_field(self) -> Markup:
        """Returns the HTML of the field that names the result."""
        return macro(TEMPLATE, "name_field", self)

    def control(self, each: RequestField) -> Markup:
        """Returns the HTML of one field with its label."""
        return macro(TEMPLATE, self._kind(each), self, each)

    def _kind(self, each: RequestField) -> str:
        """The macro that writes a field."""
        if each.kind is bool or isinstance(each.entry, Output):
            return "tick"
        if isinstance(each.entry, InputFile):
            return "sent"
        if isinstance(each.entry, Item):
            return "picks" if each.many and each.is_required(JOB) else "items"
        if each.choices:
            return "choices"
        return "number" if each.kind in (int, float) else "text"

    def choose_from(self, each: RequestField) -> Sequence[ItemRecord]:
        """Returns the items that a field refers to one of."""
        return self.records.get(each.entry.noun, ()) if isinstance(each.entry, Item) else ()

    def words(self, name: str) -> str:
        """Returns the label of a field, or one of its choices."""
        return self.context.say(f"{self.group}.{name}")

    def hint(self, name: str) -> str:
        """Returns the text below a field; empty for none."""
        key = f"{self.group}.{name}_hint"
        return self.context.say(key) if self.context.say.has(key) else ""

    def first_value(self, each: RequestField) -> str:
        """Returns the initial number of a field."""
        stated = self.values.get(each.name, each.default)
        return "" if stated is None else f"{stated:g}"

    def is_needed(self, each: RequestField) -> bool:
        """Returns whether a number cannot be left out."""
        free = each.optional and each.name not in self.values
        return not (each.entry.advanced or free)

    def step(self, each: RequestField) -> str:
        """Returns the step of a number field."""
        return "1" if each.kind is int else "any"

    def bounds(self, each: RequestField) -> Iterator[tuple[str, str]]:
        """Yields the attributes ``min`` and ``max`` of a number."""
        for name, end in zip(("min", "max"), each.entry.offered or _limits(each), strict=True):
            if end is not None:
                yield name, f"{end:g}"


def _limits(each: RequestField) -> tuple[float | None, float | None]:
    """The least and the largest number of the type, or the ends that it must not reach."""
    low, high = each.entry.least, None
    for limit in each.info.metadata:
        if isinstance(limit, Ge | Gt):
            low = float(str(limit.ge if isinstance(limit, Ge) else limit.gt))
        elif isinstance(limit, Le | Lt):
            high = float(str(limit.le if isinstance(limit, Le) else limit.lt))
    return low, high
