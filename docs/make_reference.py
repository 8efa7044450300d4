"""Renews the parts of the reference that are made from requests of operations.

``python docs/make_reference.py`` writes them; ``--check`` fails where one is out of date. In
``reference/cli.md`` a part stands between ``<!-- options of NAME -->`` and
``<!-- end of options -->``: the usage of the command and the table of its options. In
``reference/workspace.md`` it is the table of the kinds of jobs, between
``<!-- parameters of jobs -->`` and ``<!-- end of parameters -->``.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Final

from robotrue.app.registry import job_operations, listings, operation_of
from robotrue.app.request import CLI, JOB, RequestField, fields_of

REFERENCE: Final = Path(__file__).parent / "reference"
OPTIONS: Final = re.compile(r"(<!-- options of ([a-z -]+) -->\n).*?(<!-- end of options -->)", re.S)
JOBS: Final = re.compile(r"(<!-- parameters of jobs -->\n).*?(<!-- end of parameters -->)", re.S)
NO_VALUE: Final = "–"


def options_of(name: str) -> str:
    """Returns the usage of a command and the table of its options, as Markdown."""
    (listing,) = [each for each in listings() if f"{each.group} {each.command}".strip() == name]
    fields = [each for each in fields_of(operation_of(listing.name).request) if each.is_in(CLI)]
    placed = [_usage(each) for each in fields if each.entry.argument]
    options = [_usage(each) for each in fields if not each.entry.argument]
    rows = [_row(each) for each in fields]
    return "\n".join(
        [
            "```text",
            " ".join([f"robotrue {name}", *placed, *options, "[--json]"]),
            "```",
            "",
            "| argument or option | meaning | default |",
            "|---|---|---|",
            *rows,
            f"| `--json` | machine-readable result on stdout | {NO_VALUE} |",
            "",
        ]
    )


def _spelled(field: RequestField) -> list[str]:
    if field.entry.argument:
        return [field.entry.argument]
    names = sorted(field.entry.names or (field.option,), key=len)
    return [*names, *([f"--no-{field.option[2:]}"] if field.entry.paired else [])]


def _usage(field: RequestField) -> str:
    name = _spelled(field)[0]
    if field.entry.argument or field.kind is bool:
        return name if field.is_required(CLI) or field.entry.argument else f"[{name}]"
    value = field.entry.metavar or field.option.lstrip("-").replace("-", "_").upper()
    used = f"{name} {value}"
    return used if field.is_required(CLI) else f"[{used}]{' ...' if field.many else ''}"


def _row(field: RequestField) -> str:
    spelled = ", ".join(f"`{name}`" for name in _spelled(field)).replace("|", "\\|")
    default = "needed" if field.is_required(CLI) else _default(field, "`{}`") or NO_VALUE
    help = field.entry.help.replace("|", "\\|")
    meaning = help if help.endswith("...") else help.removesuffix(".")
    return f"| {spelled} | {meaning} | {default} |"


def _default(field: RequestField, form: str) -> str:
    """The default as it is shown; empty for a flag that is off and a value that may be missing."""
    said = field.default is not None and field.default is not False and field.default != ()
    return form.format(field.default) if said else ""


def parameters_of_jobs() -> str:
    """Returns the table of the kinds of jobs that leave items of their own, as Markdown."""
    rows = ["| kind | parameters, and their defaults |", "|---|---|"]
    for kind, operation in job_operations().items():
        if operation.save is None:  # the options of its command, in cli.md
            continue
        fields = [field for field in fields_of(operation.request) if field.is_in(JOB)]
        stated = [f"`{field.name}`{_default(field, ' ({})')}" for field in fields]
        rows.append(f"| `{kind}` | {', '.join(stated)} |")
    return "\n".join([*rows, ""])


def renew_text(name: str, text: str) -> str:
    """Returns the text of a page of the reference with its made parts as they are today."""
    if name == "cli.md":
        return OPTIONS.sub(lambda m: f"{m[1]}{options_of(m[2])}{m[3]}", text)
    return JOBS.sub(lambda m: f"{m[1]}{parameters_of_jobs()}{m[2]}", text)


def main() -> int:
    """Writes the pages, or returns 1 where ``--check`` finds one out of date."""
    stale = 0
    for name in ("cli.md", "workspace.md"):
        path = REFERENCE / name
        text = path.read_text(encoding="utf-8")
        made = renew_text(name, text)
        if made != text:
            stale += 1
            if "--check" in sys.argv:
                sys.stderr.write(f"{path} is out of date: python docs/make_reference.py\n")
            else:
                path.write_text(made, encoding="utf-8")
    return int("--check" in sys.argv and stale > 0)


if __name__ == "__main__":
    raise SystemExit(main())
