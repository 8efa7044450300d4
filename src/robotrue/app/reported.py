"""Report commands: the options all of them have, and which files they write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, TypeAlias

from robotrue.app.outputs import check_output
from robotrue.app.request import Option
from robotrue.errors import ConfigurationError

Language: TypeAlias = Annotated[str, Option(names=("--lang",), help="en or zh.")]


def check_reports(outputs: Sequence[Path], sources: Sequence[Path]) -> None:
    """Refuses, before any work is done, outputs that cannot be.

    Raises:
        ConfigurationError: Another ending than ``.html``, ``.pdf``, ``.json``, or a file or folder
            :func:`check_output` refuses.
    """
    from robotrue.report.report_files import SUFFIXES, json_twin

    for output in outputs:
        if output.suffix.lower() not in SUFFIXES:
            raise ConfigurationError(
                f"a report is {', '.join(SUFFIXES)}, not {output.suffix or 'without an ending'!r}.",
                source=output,
                hint=f"-o {output.with_suffix('.html').name}",
            )
        check_output(output, sources)
        check_output(json_twin(output), sources)
