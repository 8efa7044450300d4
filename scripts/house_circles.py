"""Circles between files: groups of files that import each other, at the top or in functions."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence

from house_tree import SourceFile, statements


def find_circles(files: Sequence[SourceFile]) -> list[tuple[str, ...]]:
    """Returns each strongly connected group of two or more modules, names sorted.

    Imports inside functions count, and so do those for types alone: whoever reads one of the files
    has to read the other.
    """
    graph = import_graph(files)
    return sorted(group for group in _components(graph) if len(group) > 1)


def import_graph(files: Sequence[SourceFile]) -> dict[str, set[str]]:
    """Returns, for each module of the package, the modules of the package that it imports."""
    known = {file.module for file in files}
    return {file.module: set(_imported(file, known)) - {file.module} for file in files}


def _imported(file: SourceFile, known: set[str]) -> Iterator[str]:
    for node in statements(file.tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                below = f"{node.module}.{alias.name}"
                if below in known:
                    yield below
                elif node.module in known:
                    yield node.module


def _components(graph: Mapping[str, set[str]]) -> Iterator[tuple[str, ...]]:
    """Tarjan's algorithm with a stack of its own."""
    index: dict[str, int] = {}
    lowest: dict[str, int] = {}
    path: list[str] = []
    on_path: set[str] = set()
    for start in graph:
        if start in index:
            continue
        index[start] = lowest[start] = len(index)
        path.append(start)
        on_path.add(start)
        work = [(start, iter(sorted(graph[start])))]
        while work:
            module, following = work[-1]
            for target in following:
                if target not in index:
                    index[target] = lowest[target] = len(index)
                    path.append(target)
                    on_path.add(target)
                    work.append((target, iter(sorted(graph[target]))))
                    break
                if target in on_path:
                    lowest[module] = min(lowest[module], index[target])
            else:
                work.pop()
                if work:
                    above = work[-1][0]
                    lowest[above] = min(lowest[above], lowest[module])
                if lowest[module] == index[module]:
                    cut = path.index(module)
                    yield tuple(sorted(path[cut:]))
                    on_path.difference_update(path[cut:])
                    del path[cut:]
