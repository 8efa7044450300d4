"""What is measured of the source tree: sizes, names, types, comments."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from defaults import find_doubles
from house_circles import find_circles
from house_tree import SourceFile, statements

LONGEST_FILE: Final = 500
LONGEST_FUNCTION: Final = 50
MOST_OF_A_NAME: Final = 2
"""Files of the tree that may have the same name."""
Function = ast.FunctionDef | ast.AsyncFunctionDef
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
_COMPILERS: Final = {"compile_kernel", "njit", "jit", "vectorize", "guvectorize"}
_LONG_TEXT: Final = re.compile(r'"""[\s\S]*?"""')
_COMMENT: Final = re.compile(r"^\s*#", re.MULTILINE)
_NO_CODE: Final = re.compile(
    r"""#.*|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)*'|^(?:from|import)\b.*""", re.MULTILINE
)
_NO_PARTICIPLE: Final = {
    "need",
    "feed",
    "speed",
    "seed",
    "embed",
    "proceed",
    "exceed",
    "shed",
    "bed",
}
_IRREGULAR: Final = set(
    "bent begun built chosen drawn driven fed felt found given gone gotten grown heard held "
    "kept known laid led left lent lost made meant met paid said seen sent  shown "
    "spent spun stood sunk taken taught thought told torn understood won written".split()
)
_ATTACHED: Final = set(
    "above across after against apart as at aside away back before behind below beside between by "
    "down for from in inside into of off on onto out over per to together under up upon via with "
    "without".split()
)


@dataclass(frozen=True, slots=True, kw_only=True)
class House:
    """The measures of one tree. Lists name places, for whoever wants to mend them."""

    rooms: dict[str, tuple[int, int]]
    files: int
    lines: int
    import_lines: int
    docstrings: int
    docstring_lines: int
    comment_lines: int
    kernel_files: int
    kernel_lines: int
    any_uses: int
    functions: int
    function_lengths: dict[str, int]
    long_files: list[str]
    long_functions: list[str]
    circles: list[tuple[str, ...]]
    double_classes: dict[str, list[str]]
    frequent_files: dict[str, list[str]]
    participles: list[str]
    same_defaults: dict[str, list[str]]
    different_defaults: dict[str, list[str]]

    def document(self) -> dict[str, Any]:
        """Returns JSON values."""
        return asdict(self)


def measure_house(files: Sequence[SourceFile]) -> House:
    """Returns the measures of a tree."""
    rooms: dict[str, tuple[int, int]] = {}
    classes, names = defaultdict(list), defaultdict(list)
    count: Counter[str] = Counter()
    lengths: list[tuple[int, str]] = []
    participles = []
    for file in files:
        n, total = rooms.get(file.room, (0, 0))
        rooms[file.room] = (n + 1, total + file.lines)
        if file.name != "__init__":
            names[file.name].append(file.path)
        nodes = [file.tree, *statements(file.tree)]
        count += _counts(file, nodes)
        for node in nodes:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].append(f"{file.path}:{node.lineno}")
            elif isinstance(node, Function):
                place = f"{file.path}:{node.lineno} {node.name}"
                lengths.append((_length(node), place))
                if is_participle(node):
                    participles.append(place)
    doubles = find_doubles(files)
    ordered = sorted(length for length, _ in lengths)
    return House(
        rooms=dict(sorted(rooms.items())),
        files=len(files),
        lines=sum(file.lines for file in files),
        import_lines=count["import lines"],
        docstrings=count["docstrings"],
        docstring_lines=count["docstring lines"],
        comment_lines=count["comment lines"],
        kernel_files=count["kernel files"],
        kernel_lines=count["kernel lines"],
        any_uses=count["Any"],
        functions=len(ordered),
        function_lengths={
            name: ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else 0
            for name, share in (("p50", 0.5), ("p90", 0.9), ("p99", 0.99), ("max", 1.0))
        },
        long_files=[f"{f.path} {f.lines}" for f in files if f.lines > LONGEST_FILE],
        long_functions=[
            f"{p} {n}" for n, p in sorted(lengths, reverse=True) if n > LONGEST_FUNCTION
        ],
        circles=find_circles(files),
        double_classes={k: v for k, v in sorted(classes.items()) if len(v) > 1},
        frequent_files={k: v for k, v in sorted(names.items()) if len(v) > MOST_OF_A_NAME},
        participles=participles,
        same_defaults={k: [s.place for s in v] for k, v in doubles.same.items()},
        different_defaults={k: [s.place for s in v] for k, v in doubles.different.items()},
    )


def is_participle(node: Function) -> bool:
    """Returns whether a function is named by a participle where a verb is wanted.

    ``gathered``, ``judged_by``, ``_rows_of``: the first two. A participle before a noun
    (``fitted_frame``) names what is returned, and a property is a noun anyhow.
    """
    decorators = {ast.unparse(each) for each in node.decorator_list}
    if any(
        "property" in each or re.search(r"\.(setter|command|get|post|put|delete)\b", each)
        for each in decorators
    ):
        return False
    words = node.name.strip("_").split("_")
    return _participle(words[0]) and (len(words) == 1 or set(words[1:]) <= _ATTACHED)


def _participle(word: str) -> bool:
    return word in _IRREGULAR or (
        word.endswith("ed") and len(word) > 3 and word not in _NO_PARTICIPLE
    )


def _length(node: Function) -> int:
    """Lines from ``def`` to the end, without the docstring."""
    text = _docstring(node)
    return _lines(node) - (_lines(text) if text is not None else 0)


def _lines(node: ast.stmt | ast.expr) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


def _counts(file: SourceFile, nodes: Sequence[ast.AST]) -> Counter[str]:
    count: Counter[str] = Counter()
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            count["import lines"] += _lines(node)
        elif isinstance(node, _DOCUMENTED) and (text := _docstring(node)) is not None:
            count["docstrings"] += 1
            count["docstring lines"] += _lines(text)
        if isinstance(node, Function) and any(map(_compiles, node.decorator_list)):
            count["kernel files"] = 1
    count["kernel lines"] = file.lines * count["kernel files"]
    unquoted = _LONG_TEXT.sub(lambda text: "\n" * text[0].count("\n"), file.text)
    count["comment lines"] = len(_COMMENT.findall(unquoted))
    count["Any"] = len(re.findall(r"\bAny\b", _NO_CODE.sub("", unquoted)))
    return count


def _docstring(node: ast.AST) -> ast.Constant | None:
    body = getattr(node, "body", [])
    first = body[0].value if body and isinstance(body[0], ast.Expr) else None
    return first if isinstance(first, ast.Constant) and isinstance(first.value, str) else None


def _compiles(decorator: ast.expr) -> bool:
    node = decorator.func if isinstance(decorator, ast.Call) else decorator
    return (node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")) in _COMPILERS
