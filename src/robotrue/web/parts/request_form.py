"""Fields of forms, made from the request of an operation.

Labels come from the languages: ``<group>.<field>``, its choices ``<group>.<field>_<choice>``, the
text of an item that may be left out ``<group>.<field>_none``, a hint ``<group>.<field>_hint``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

from annotated_types import Ge, Le

from robotrue.app.request import FORM, JOB, Item, Output, Request, RequestField, fields_of
from robotrue.store.records import ItemRecord
from robotrue.web.bench import Bench

LONGEST_NAME = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestForm:
    """What the fields of a request look like for one reader.

    Attributes:
        bench: Who looks at it.
        request: Type of the request.
        group: Of the texts.
        records: Items to choose from, by noun.
        marks: ``data-testid`` of fields, by field; ``name`` for the name of the result.
        without: Fields that the page builds itself.
        values: What stands in a field at first in place of its default; it cannot be emptied.
    """

    bench: Bench
    request: type[Request]
    group: str
    records: Mapping[str, Sequence[ItemRecord]] = field(default_factory=dict)
    marks: Mapping[str, str] = field(default_factory=dict)
    without: frozenset[str] = frozenset()
    values: Mapping[str, Any] = field(default_factory=dict)

    def fields(self, *, advanced: bool) -> str:
        """Returns the HTML of the fields in sight, or of those behind "more"."""
        return "".join(
            self.control(each)
            for each in fields_of(self.request)
            if each.is_in(FORM)
            and each.entry.advanced is advanced
            and each.name not in self.without
        )

    def name_field(self) -> str:
        """Returns the HTML of the field that names the result."""
        return self._labelled(
            "name",
            f'<input type="text" name="name" maxlength="{LONGEST_NAME}"{self._mark("name")}>',
        )

    def control(self, each: RequestField) -> str:
        """Returns the HTML of one field with its label."""
        if each.kind is bool or isinstance(each.entry, Output):
            checked = " checked" if each.default is True else ""
            return (
                f"<label class='tick'><input type='checkbox' name='{each.name}'{checked}"
                f"{self._mark(each.name)}>{escape(self._text(each.name))}</label>"
            )
        if isinstance(each.entry, Item):
            return self._items(each, each.entry)
        if each.choices:
            return self._labelled(each.name, self._choices(each))
        if each.kind in (int, float):
            return self._labelled(each.name, self._number(each))
        one = (
            f'<input type="text" name="{each.name}{"[]" if each.many else ""}" '
            f'placeholder="{escape(each.entry.example)}" maxlength="{LONGEST_NAME}"'
            f"{self._mark(each.name)}>"
        )
        return self._labelled(each.name, one * 2 if each.many else one)

    def _items(self, each: RequestField, entry: Item) -> str:
        records = self.records.get(entry.noun, ())
        if each.many and each.is_required(JOB):
            return "".join(
                f'<label><input type="checkbox" name="{each.name}[]" value="{record.id}"'
                f"{self._mark(each.name)}>{escape(record.name)}{_size(record)}</label>"
                for record in records
            )
        listed = "".join(
            f'<option value="{r.id}">{escape(r.name)}{_size(r, " · {:,}")}</option>'
            for r in records
        )
        if each.optional or each.many:
            none = escape(self._text(f"{each.name}_none"))
            listed = f'<option value="">{none}</option>{listed}'
        control = f'<select name="{each.name}"{self._mark(each.name)}>{listed}</select>'
        return self._labelled(each.name, control)

    def _choices(self, each: RequestField) -> str:
        listed = ""
        for choice in each.choices:
            text = self._text(f"{each.name}_{choice.lower().replace('-', '_')}")
            selected = " selected" if choice == each.default else ""
            listed += f'<option value="{choice}"{selected}>{escape(text)}</option>'
        return f'<select name="{each.name}"{self._mark(each.name)}>{listed}</select>'

    def _number(self, each: RequestField) -> str:
        low, high = each.entry.offered or _limits(each)
        stated = self.values.get(each.name, each.default)
        value = "" if stated is None else f"{stated:g}"
        ends = (("min", low), ("max", high))
        bounds = "".join(f' {name}="{end:g}"' for name, end in ends if end is not None)
        step = "1" if each.kind is int else "any"
        free = each.optional and each.name not in self.values
        needed = "" if each.entry.advanced or free else " required"
        return (
            f'<input type="number" name="{each.name}" value="{value}"{bounds} step="{step}"'
            f"{needed}{self._mark(each.name)}>"
        )

    def _labelled(self, name: str, control: str) -> str:
        hint = f"{self.group}.{name}_hint"
        say = self.bench.say
        below = f"<span>{escape(say(hint))}</span>" if say.known(hint) else ""
        return f"<label class='field'>{escape(self._text(name))}{control}{below}</label>"

    def _text(self, name: str) -> str:
        return self.bench.say(f"{self.group}.{name}")

    def _mark(self, name: str) -> str:
        return f" data-testid='{self.marks[name]}'" if name in self.marks else ""


def _size(record: ItemRecord, form: str = '<span class="note">{:,}</span>') -> str:
    poses = getattr(record, "poses", None)
    return "" if poses is None else form.format(poses)


def _limits(each: RequestField) -> tuple[float | None, float | None]:
    """The least and the largest number of the type."""
    low = high = None
    for limit in each.info.metadata:
        if isinstance(limit, Ge):
            low = float(str(limit.ge))
        elif isinstance(limit, Le):
            high = float(str(limit.le))
    return low, high
