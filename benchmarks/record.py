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
    """Writes the record unless the command crashes; 1 is the exit status of a missed aim."""
    program = sys.executable if command[0] == "python" else command[0]
    print(shlex.join(command), flush=True)
    done = subprocess.run([program, *command[1:]], capture_output=True, text=True)
    if done.returncode not in (0, 1) or not done.stdout or "Traceback" in done.stderr:
        raise SystemExit(done.stderr)
    head = f"$ {shlex.join(command)}\n{machine()}\n\n"
    text = re.sub(r" +$", "", head + done.stdout, flags=re.MULTILINE)
    (RECORDS / f"{name}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
