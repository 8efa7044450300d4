"""The form of any operation, made from its request alone.

Labels are the names of fields and hints their help, where the languages have no texts for them:
``tools.field_<name>``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from markupsafe import Markup

from robotrue.app.job_files import job_fields, result_name, takes_files
from robotrue.app.job_parameters import is_list
from robotrue.app.operation import AnyOperation
from robotrue.app.request import JOB, InputFile, Item, Output, RequestField
from robotrue.store.records import ItemRecord
from robotrue.web.language import Wording
from robotrue.web.parts.request_form import RequestForm, name_options
from robotrue.web.templating import macro

TEMPLATE: Final = "generated_form.html"
UNITS: Final[Mapping[str, str]] = {
    "mm_per_s": "mm/s", "mm_per_min": "mm/min", "um_per_n": "µm/N", "mm": "mm", "um": "µm",
    "deg": "°", "hz": "Hz", "rpm": "1/min", "ms": "ms", "s": "s", "N": "N", "n": "N", "kg": "kg",
}  # fmt: skip
"""How the ends of names that are units are printed."""
MORE_TEXTS: Final = 3
"""Fields of a list of texts."""
_COMMAND: Final = re.compile(r"`([^`]+)`")


@dataclass(frozen=True, slots=True, kw_only=True)
class GeneratedForm(RequestForm):
    """The form of an operation for one reader.

    Attributes:
        operation: Of the job.
        files: Items that have files to choose from, by their heading.
        chosen: Id of the initially chosen item, by noun.
        stated: Parameters of an earlier job, the initial values of the fields.
    """

    operation: AnyOperation
    files: Mapping[str, Sequence[ItemRecord]] = field(default_factory=dict)
    chosen: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, object] = field(default_factory=dict)

    def parts(self) -> Iterator[tuple[str, Markup]]:
        """Yields the heading and the fields of each part of the form that has some."""
        stated = job_fields(self.operation)
        for part in ("inputs", "settings", "results"):
            fields = [each for each in stated if _part(each) == part]
            if fields:
                yield part, Markup().join(self.control(each) for each in fields)

    def control(self, each: RequestField) -> Markup:
        """Returns the HTML of one field with its label and its help."""
        return macro(TEMPLATE, self._kind(each), self, each)

    def _kind(self, each: RequestField) -> str:
        """The macro that writes a field."""
        if isinstance(each.entry, InputFile):
            return "files"
        if isinstance(each.entry, Item):
            return "picks" if each.many_in_jobs else "items"
        if isinstance(each.entry, Output):
            return "tick" if self.operation.save is not None else "result"
        if each.kind is bool:
            return "tick"
        if each.choices:
            return "picked_choices" if each.many else "choices"
        return "number" if each.kind in (int, float) and not each.many else "text"

    def words(self, name: str) -> str:
        """Returns the label of a field: its words, or its name with the unit in brackets."""
        return field_words(self.context.say, name)

    def hint(self, name: str) -> str:
        """Returns the help of a field, with labels in place of options of the command line."""
        fields = {each.name: each for each in job_fields(self.operation)}
        stated = _COMMAND.sub(r"“\1”", fields[name].entry.help)
        return str(name_options(stated, fields.values(), self.words))

    def list_offers(self, each: RequestField) -> list[tuple[str, Sequence[ItemRecord]]]:
        """Returns the items that a field may refer to, by their noun in the reader's words."""
        entry = each.entry
        nouns = (entry.noun, *entry.also) if isinstance(entry, Item) else ()
        known = [(self.context.say.word("history.noun", n), self.records.get(n, ())) for n in nouns]
        return [(noun, records) for noun, records in known if records]

    def is_required(self, each: RequestField) -> bool:
        """Returns whether a job cannot do without a field."""
        return each.is_required(JOB) and not isinstance(each.entry, Output)

    def list_files(self, each: RequestField) -> Mapping[str, Sequence[ItemRecord]]:
        """Returns the stored files to choose from: items, and files that were sent before."""
        if isinstance(each.entry, InputFile):
            return self.files
        heading = self.context.say("tools.kept_inputs")
        return {heading: self.files[heading]} if heading in self.files else {}

    def takes_files(self, each: RequestField) -> bool:
        """Returns whether a file may be sent in place of an item."""
        return takes_files(each)

    def is_list(self, each: RequestField) -> bool:
        """Returns whether a field may have several values."""
        return is_list(each)

    def first_value(self, each: RequestField) -> str:
        """Returns the initial number of a field."""
        value = self.stated.get(each.name, each.default)
        return f"{value:g}" if isinstance(value, int | float) else ""

    def first_texts(self, each: RequestField) -> list[str]:
        """Returns the initial texts of a field, with room for more of a list."""
        stated = self.stated.get(each.name, each.default)
        if not each.many:
            return ["" if stated is None else str(stated)]
        known = [str(text) for text in (stated if isinstance(stated, list | tuple) else ())]
        return known + [""] * max(MORE_TEXTS - len(known), 1)

    def first_names(self, each: RequestField) -> list[str]:
        """Returns the names of results at first; empty where it is only written on request."""
        usual = self.usual_name(each)
        stated = self.stated.get(each.name, usual if each.required else "")
        listed = stated if isinstance(stated, list) else [stated]
        return [usual if name is True else str(name or "") for name in listed or [""]]

    def first_item(self, each: RequestField) -> str:
        """Returns the id of the item that is chosen at first."""
        noun = each.entry.noun if isinstance(each.entry, Item) else ""
        usual = self.chosen.get(noun, "") if self.is_required(each) else ""
        return next(iter(self._ids(each)), usual)

    def is_chosen(self, each: RequestField, value: object) -> bool:
        """Returns whether a tick is set, a choice or an item chosen at first."""
        stated = self.stated.get(each.name, each.default)
        listed = stated if isinstance(stated, list | tuple) else [stated]
        return value in listed or value in self._ids(each)

    def is_kept_file(self, each: RequestField, record: ItemRecord, file: str) -> bool:
        """Returns whether an earlier job read a file."""
        stated = self.stated.get(each.name)
        meant = {"id": record.id, "version": record.version, "file": file}
        return meant in (stated if isinstance(stated, list) else [stated])

    def _ids(self, each: RequestField) -> list[str]:
        """The items that an earlier job stated in a field."""
        stated = self.stated.get(each.name) or []
        listed = stated if isinstance(stated, list) else [stated]
        return [str(one.get("id")) if isinstance(one, Mapping) else str(one) for one in listed]

    def usual_name(self, each: RequestField) -> str:
        """Returns the name of a result where none is stated."""
        return result_name(self.request, each)

    def file_value(self, record: ItemRecord, file: str) -> str:
        """Returns the parameter that means a file of an item."""
        return json.dumps({"id": record.id, "version": record.version, "file": file})


def field_words(say: Wording, name: str) -> str:
    """Returns the label of a field: its words, or its name with the unit in brackets."""
    key = f"tools.field_{name}"
    if say.has(key):
        return say(key)
    for end, unit in UNITS.items():
        if name.endswith(f"_{end}"):
            return f"{_as_words(name.removesuffix(f'_{end}'))} ({unit})"
    return _as_words(name)


def _part(each: RequestField) -> str:
    if isinstance(each.entry, Output):
        return "results"
    return "inputs" if isinstance(each.entry, Item | InputFile) else "settings"


def _as_words(name: str) -> str:
    return name[:1].upper() + name[1:].replace("_", " ")
