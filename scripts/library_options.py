"""Renews the option types of the library from the requests of the operations.

``python scripts/library_options.py`` writes ``src/robotrue/library/option_types.py``; ``--check``
fails where it is out of date. An option type has names and types; defaults are in the requests.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Final

from robotrue.app.plan_request import OF_HIERARCHY
from robotrue.app.request import InputFile, Item, Output, RequestField
from robotrue.library.operation_call import command_fields

TARGET: Final = Path(__file__).parents[1] / "src" / "robotrue" / "library" / "option_types.py"
STATED: Final = {
    "calibrate": ("cell", "measurements", "output"),
    "transfer": ("cell", "measurements", "output", "source", "fleet"),
    "validate": ("model", "measurements"),
    "compensate": ("model", "program", "output", "cell"),
    "plan": ("cell", "model", "output", "method", *OF_HIERARCHY),
}
"""Fields that a function of the library states itself."""
HEAD: Final = '''"""Options of the library's functions; made by ``scripts/library_options.py``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypedDict
'''


def annotation_of(field: RequestField) -> str:
    """Returns the type of a field as Python source."""
    if isinstance(field.entry, Item | InputFile | Output) or field.kind is Path:
        kind = "str | Path"
    elif field.choices:
        kind = (
            f"Literal[{', '.join(repr(each).replace(chr(39), chr(34)) for each in field.choices)}]"
        )
    else:
        kind = getattr(field.kind, "__name__", "object")
    if field.many:
        kind = f"{kind} | Sequence[{kind}]"
    return f"{kind} | None" if field.optional else kind


def option_types() -> str:
    """Returns the source of the module."""
    parts = [HEAD]
    for name, stated in STATED.items():
        lines = [f"class {name.title()}Options(TypedDict, total=False):"]
        lines += [f'    """Further options of ``{name}``."""', ""]
        lines += [
            f"    {field.name}: {annotation_of(field)}"
            for field in command_fields(name)
            if field.name not in stated
        ]
        parts.append("\n".join(lines) + "\n")
    command = [sys.executable, "-m", "ruff", "format", "--stdin-filename", TARGET.name, "-"]
    source = "\n\n".join(parts)
    done = subprocess.run(  # noqa: S603  the formatter of this repository
        [*command, "--line-length", "100"], input=source, capture_output=True, text=True, check=True
    )
    return done.stdout


def main() -> int:
    """Writes the module, or returns 1 where ``--check`` finds it out of date."""
    made = option_types()
    stale = not TARGET.is_file() or TARGET.read_text(encoding="utf-8") != made
    if "--check" in sys.argv:
        if stale:
            sys.stderr.write(f"{TARGET} is out of date: python scripts/library_options.py\n")
        return int(stale)
    TARGET.write_text(made, encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
