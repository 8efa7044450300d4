"""Fails unless pyproject, package, changelog, CITATION.cff and recipe name the same version."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def found(path: str, pattern: str) -> str:
    """Returns the first match of the pattern in a file of the repository, or ''."""
    match = re.search(pattern, (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE)
    return match.group(1) if match else ""


def main() -> int:
    """Returns 0 if all of them agree."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    versions = {
        "pyproject.toml": project["version"],
        "src/robotrue/version.py": found("src/robotrue/version.py", r'^__version__ = "([^"]+)"'),
        "CHANGELOG.md": found("CHANGELOG.md", r"^## (\d+\.\d+\.\d+)"),
        "CITATION.cff": found("CITATION.cff", r'^version: "?([^"\n]+)"?'),
        "packaging/conda/meta.yaml": found("packaging/conda/meta.yaml", r'^  version: "([^"]+)"'),
    }
    if len(set(versions.values())) == 1:
        return 0
    for name, version in versions.items():
        sys.stderr.write(f"{name}: {version or 'no version found'}\n")
    return 1


if __name__ == "__main__":
    raise SystemExit(main())
