"""Runs a command and saves what it prints as a record of the documentation.

    python benchmarks/record.py rail_arm python benchmarks/rail_arm.py

``docs/records/rail_arm.txt`` then holds the command, date and machine, and the output.
``tests/docs/test_result_numbers.py`` compares the pages with it.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from run import machine

RECORDS = Path(__file__).parents[1] / "docs" / "records"


def main(name: str, command: list[str]) -> None:
    """Writes the record if the command succeeds."""
    program = sys.executable if command[0] == "python" else command[0]
    print(shlex.join(command), flush=True)
    done = subprocess.run([program, *command[1:]], stdout=subprocess.PIPE, text=True, check=True)
    head = f"$ {shlex.join(command)}\n{machine()}\n\n"
    (RECORDS / f"{name}.txt").write_text(
        head + re.sub(r" +$", "", done.stdout, flags=re.MULTILINE), encoding="utf-8"
    )


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
