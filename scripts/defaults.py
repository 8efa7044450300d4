"""Defaults that are spelled more than once: one parameter name, a default in two places or more.

``python scripts/defaults.py`` lists each name with its values and places; ``--count`` prints the
sums. A default stands in a signature, a field of a dataclass or of a pydantic model, an option of
a command, a call that reads a parameter of a job (``asked.number("max_shift_mm", 10.0)``), or a
field of a form. ``max_shift_mm = 10.0`` and ``max_shift = 10e-3`` are one name and one value. A
constant is the one place of all defaults that name it. ``None``, ``False``, zero and what is empty
are no defaults here. ``defaults_allowed.toml`` names, with a reason each, what may differ because
one word means several things (``[different]``), or may be spelled twice (``[same]``).
"""

from __future__ import annotations

import argparse
import ast
import math
import re
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from house_tree import SourceFile, read_tree, statements

ALLOWED: Final = Path(__file__).with_name("defaults_allowed.toml")
DEG: Final = math.pi / 180.0
UNITS: Final[Mapping[str, float]] = {
    "m": 1.0, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "deg": DEG, "s": 1.0, "ms": 1e-3, "hz": 1.0,
    "kg": 1.0, "n": 1.0,
}  # fmt: skip
"""Last word of a name and what it is in SI."""
FACTORS: Final[Mapping[str, float]] = {"MM": 1e-3, "UM": 1e-6, "DEG": DEG, "MS": 1e-3}
READERS: Final[Mapping[str, tuple[type, ...]]] = {
    "text": (str,), "number": (int, float), "whole": (int,), "flag": (bool,), "get": (int, float),
}  # fmt: skip
"""Calls whose first argument names a parameter and whose second is its default, of these types."""
_FORM: Final = re.compile(r'name="(\w+)"[^<>]*?\bvalue="(-?\d+\.?\d*|[A-Z_]+)"')


@dataclass(frozen=True, slots=True, kw_only=True)
class Spelling:
    """One default where it is written.

    Attributes:
        name: Of the parameter, without its unit.
        value: In SI; text and tuples as they are.
        shown: As written.
        place: File, line, and what it belongs to.
    """

    name: str
    value: Any
    shown: str
    place: str


def spellings(files: Sequence[SourceFile]) -> list[Spelling]:
    """Returns every default of a tree once for each place it is written in."""
    constants = {file.module: _constants(file) for file in files}
    found: dict[tuple[str, str], Spelling] = {}
    for file in files:
        names = _visible(file, constants)
        for name, node, owner in _defaults(file):
            place = f"{file.path}:{node.lineno} {owner}"
            value, shown = _value(node, names), ast.unparse(node)
            word = _constant_of(node)
            if word in names and isinstance(node, ast.BinOp):
                place = names[word][0]
            elif word:
                place, value, shown = names.get(word, (place, None, shown))
            reader = READERS.get(owner.removesuffix("(...)"))
            if value and value is not Ellipsis and (reader is None or isinstance(value, reader)):
                plain, factor = _plain(name)
                value = _rounded(value, factor)
                found[plain, place] = Spelling(name=plain, value=value, shown=shown, place=place)
    return list(found.values())


def _constant_of(node: ast.expr) -> str:
    """The constant that a default names, alone or times a unit; empty for none."""
    if isinstance(node, ast.BinOp):
        return _constant_of(node.left)
    return node.id if isinstance(node, ast.Name) else getattr(node, "attr", "")


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubles:
    """Names with more than one spelling.

    Attributes:
        same: Names of which one value is written in several places, with all spellings.
        different: Names of which several values are written, with all spellings.
    """

    same: dict[str, list[Spelling]]
    different: dict[str, list[Spelling]]


def find_doubles(files: Sequence[SourceFile]) -> Doubles:
    """Returns the defaults of a tree that are spelled more than once and not allowed."""
    groups: dict[str, list[Spelling]] = defaultdict(list)
    for each in sorted(spellings(files), key=lambda each: (str(each.value), each.place)):
        groups[each.name].append(each)
    allowed = tomllib.loads(ALLOWED.read_text(encoding="utf-8"))
    same, different = {}, {}
    for name, group in sorted(groups.items()):
        values = Counter(str(each.value) for each in group)
        if max(values.values()) > 1 and name not in allowed["same"]:
            same[name] = group
        if len(values) > 1 and name not in allowed["different"]:
            different[name] = group
    return Doubles(same=same, different=different)


def _constants(file: SourceFile) -> dict[str, tuple[str, Any, str]]:
    """Place, value and text of the constants of a file."""
    found = {}
    for node in file.tree.body:
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        for target in targets:
            if not isinstance(target, ast.Name) or target.id in FACTORS:
                continue
            if target.id.isupper() and node.value is not None:
                place = f"{file.path}:{node.lineno} {target.id}"
                found[target.id] = (place, _value(node.value, found), ast.unparse(node.value))
    return found


def _visible(
    file: SourceFile, constants: Mapping[str, Mapping[str, tuple[str, Any, str]]]
) -> dict[str, tuple[str, Any, str]]:
    """The constants of a file and those that it imports, by the names they have in it."""
    names = dict(constants[file.module])
    for node in statements(file.tree):
        if isinstance(node, ast.ImportFrom) and node.module in constants:
            for alias in node.names:
                if alias.name in constants[node.module]:
                    names[alias.asname or alias.name] = constants[node.module][alias.name]
    return names


def _defaults(file: SourceFile) -> Iterator[tuple[str, ast.expr, str]]:
    for node in statements(file.tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _of_signature(node)
        elif isinstance(node, ast.ClassDef):
            yield from _of_fields(node)
    if any(f".{reader}(" in file.text or f" {reader}(" in file.text for reader in READERS):
        for call in ast.walk(file.tree):
            if isinstance(call, ast.Call):
                yield from _of_call(call)
    if file.room in ("web", "app") and 'value="' in file.text:
        for text in ast.walk(file.tree):
            if isinstance(text, ast.JoinedStr | ast.Constant):
                yield from _of_form(text)


def _of_form(text: ast.JoinedStr | ast.Constant) -> Iterator[tuple[str, ast.expr, str]]:
    """Numbers in the fields of a form, also those a constant puts there."""
    parts = text.values if isinstance(text, ast.JoinedStr) else [text]
    shown = ""
    for part in parts:
        inside = part.value if isinstance(part, ast.FormattedValue) else None
        shown += getattr(inside, "id", "?") if inside else str(getattr(part, "value", ""))
    for name, value in _FORM.findall(shown):
        node = ast.parse(value, mode="eval").body
        yield name, ast.copy_location(node, text), "form"


def _of_signature(
    node: ast.FunctionDef | ast.AsyncFunctionDef,
) -> Iterator[tuple[str, ast.expr, str]]:
    arguments = node.args
    plain = [*arguments.posonlyargs, *arguments.args]
    pairs = zip(plain[len(plain) - len(arguments.defaults) :], arguments.defaults, strict=True)
    for argument, default in [
        *pairs,
        *zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True),
    ]:
        if default is not None:
            yield argument.arg, default, node.name


def _of_fields(node: ast.ClassDef) -> Iterator[tuple[str, ast.expr, str]]:
    for line in node.body:
        if not (
            isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name) and line.value
        ):
            continue
        value = line.value
        if isinstance(value, ast.Call) and getattr(value.func, "id", "") in ("Field", "field"):
            named = [each.value for each in value.keywords if each.arg == "default"]
            value = next(iter([*value.args, *named]), value)
        yield line.target.id, value, node.name


def _of_call(call: ast.Call) -> Iterator[tuple[str, ast.expr, str]]:
    function = (
        call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    )
    named = [each.value for each in call.keywords if each.arg == "default"]
    if function not in READERS or not (call.args and isinstance(call.args[0], ast.Constant)):
        return
    name, default = call.args[0].value, next(iter([*named, *call.args[1:2]]), None)
    if isinstance(name, str) and name.isidentifier() and default is not None:
        yield name, default, f"{function}(...)"


def _value(node: ast.expr, names: Mapping[str, tuple[str, Any, str]]) -> Any:
    """The value of a literal or of a product of literals and units; None for all else."""
    if isinstance(node, ast.Name):
        return FACTORS.get(node.id, names.get(node.id, (None, None))[1])
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
        left, right = _value(node.left, names), _value(node.right, names)
        if isinstance(left, int | float) and isinstance(right, int | float) and right:
            return left * right if isinstance(node.op, ast.Mult) else left / right
        return None
    try:
        return ast.literal_eval(node)
    except (ValueError, TypeError):
        return None


def _plain(name: str) -> tuple[str, float]:
    """A name without its unit, and what the unit is in SI."""
    words = name.strip("_").lower().split("_")
    if len(words) > 1 and words[-1] in UNITS:
        return "_".join(words[:-1]), UNITS[words[-1]]
    return "_".join(words), 1.0


def _rounded(value: Any, factor: float) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    return float(f"{value * factor:.9g}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the defaults that are spelled more than once; returns 0."""
    parser = argparse.ArgumentParser(description="Defaults spelled more than once.")
    parser.add_argument("names", nargs="*", help="only these names")
    parser.add_argument("--against", metavar="REV", help="sums of a commit, too")
    asked = parser.parse_args(arguments)
    today = find_doubles(read_tree())
    for name, group in sorted({**today.same, **today.different}.items()):
        if asked.names and name not in asked.names:
            continue
        sys.stdout.write(f"{name}{'  DIFFERENT VALUES' if name in today.different else ''}\n")
        sys.stdout.write("".join(f"    {each.shown:<16} {each.place}\n" for each in group))
    before = {asked.against: find_doubles(read_tree(asked.against))} if asked.against else {}
    for state, found in {**before, "today": today}.items():
        sys.stdout.write(
            f"{state}: {len(found.same)} names with one default in several places, "
            f"{len(found.different)} with different defaults\n"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
