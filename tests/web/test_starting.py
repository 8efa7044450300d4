"""A start that is soon over: what a server has no use for is not loaded."""

from __future__ import annotations

import subprocess
import sys


def test_the_server_loads_no_numbers_no_http_client_and_no_other_server() -> None:
    heavy = "numpy scipy pandas numba matplotlib pyarrow alembic aiohttp requests tornado psycopg"
    code = (
        "import sys\n"
        "import robotrue.web.server\n"
        f"print([name for name in {(heavy + ' nicegui').split()!r} if name in sys.modules])"
    )
    found = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert found.stdout.strip() == "[]"


def test_pages_and_the_interface_are_made_when_first_asked_for() -> None:
    late = ("robotrue.web.api", "robotrue.web.pages.tools_screen", "robotrue.app.operations")
    code = (
        "import sys\n"
        "import robotrue.web.server\n"
        f"print([name for name in {late!r} if name in sys.modules])"
    )
    found = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert found.stdout.strip() == "[]"
