"""Notebooks of the gallery: executed in this process, and turned into pages.

``python docs/notebook_pages.py docs/notebooks/NAME.ipynb [...]`` executes notebooks, each in a new
folder, and saves their outputs in them. Building the documentation writes a page of each notebook
beside it, with its pictures; these are not part of the repository.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

FOLDER: Final = Path(__file__).parent / "notebooks"
PNG: Final = "image/png"
HTML: Final = "text/html"


def notebooks() -> list[Path]:
    """Returns the notebooks of the gallery."""
    return sorted(FOLDER.glob("*.ipynb"))


def read_notebook(path: Path) -> dict[str, Any]:
    """Returns the content of a notebook."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def execute(notebook: Mapping[str, Any], *, draw: bool = True) -> None:
    """Executes the code cells in order, in the working folder, and replaces their outputs.

    Args:
        notebook: Its content.
        draw: Turn figures into pictures; without, their outputs are their names.
    """
    names: dict[str, object] = {"__name__": "__main__"}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells, 1):
        cell["outputs"] = list(_run_cell("".join(cell["source"]), names, number, draw))
        cell["execution_count"] = number


def _run_cell(
    source: str, names: dict[str, object], number: int, draw: bool
) -> Iterator[dict[str, Any]]:
    """The outputs of a cell: what it prints, and the value of its last line."""
    tree, printed, value = ast.parse(source), io.StringIO(), None
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, f"cell {number}", "exec"), names)  # noqa: S102  our own notebooks
        if isinstance(last, ast.Expr):
            code = compile(ast.Expression(last.value), f"cell {number}", "eval")
            value = eval(code, names)  # noqa: S307  likewise
    if printed.getvalue():
        yield {"output_type": "stream", "name": "stdout", "text": lines_of(printed.getvalue())}
    if value is not None:
        yield {
            "output_type": "execute_result",
            "execution_count": number,
            "metadata": {},
            "data": dict(_representations(value, draw)),
        }


def _representations(value: Any, draw: bool) -> Iterator[tuple[str, Any]]:
    html = value._repr_html_() if hasattr(value, "_repr_html_") else None
    if draw and hasattr(value, "_repr_png_"):
        yield PNG, base64.b64encode(value._repr_png_()).decode()
    elif html is not None:
        yield HTML, lines_of(html)
    yield "text/plain", lines_of(repr(value))


def lines_of(text: str) -> list[str]:
    """Returns a text as notebooks keep it: a list of lines with their ends."""
    return text.splitlines(keepends=True)


def page_of(notebook: Mapping[str, Any], name: str) -> tuple[str, dict[str, bytes]]:
    """Returns the page of a notebook as Markdown, and its pictures by file name."""
    parts, pictures = [], {}
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            if PNG in data:
                file = f"{name}_{len(pictures) + 1}.png"
                pictures[file] = base64.b64decode(data[PNG])
                parts.append(f"![Output of the cell above]({file})")
            elif HTML in data:
                parts.append(f"```{{raw}} html\n{''.join(data[HTML])}\n```")
            else:
                text = "".join(output.get("text", data.get("text/plain", ())))
                parts.append(f"```text\n{text.rstrip()}\n```")
    origin = f"*The notebook: `docs/notebooks/{name}.ipynb`.*"
    return "\n\n".join([*parts, origin, ""]), pictures


def write_pages() -> None:
    """Writes the page of every notebook beside it."""
    for path in notebooks():
        text, pictures = page_of(read_notebook(path), path.stem)
        path.with_suffix(".md").write_text(text, encoding="utf-8")
        for name, data in pictures.items():
            (path.parent / name).write_bytes(data)


def main(arguments: list[str]) -> int:
    """Executes the notebooks named and saves their outputs."""
    for name in arguments:
        path = Path(name).resolve()
        notebook = read_notebook(path)
        here = Path.cwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                execute(notebook)
            finally:
                os.chdir(here)
        text = json.dumps(notebook, indent=1, ensure_ascii=False, sort_keys=True)
        path.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
