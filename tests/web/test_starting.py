"""A start that is soon over: what a server has no use for is not loaded, and stays usable."""

from __future__ import annotations

import gc
import importlib
import subprocess
import sys

import pytest

from robotrue.web.starting import lightly


def test_what_is_hidden_for_a_moment_can_be_had_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robotrue.web.starting.CLIENTS", ("colorsys", "json"))
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    with lightly():
        assert not gc.isenabled()
        importlib.import_module("json")  # was there before: is left alone
        with pytest.raises(ImportError):
            importlib.import_module("colorsys")
    assert gc.isenabled()
    assert importlib.import_module("colorsys").rgb_to_hsv


def test_the_server_loads_no_numbers_no_http_client_and_no_other_server() -> None:
    heavy = "numpy scipy pandas numba matplotlib pyarrow alembic aiohttp requests tornado psycopg"
    code = (
        "import sys\n"
        "from robotrue.web.starting import lightly\n"
        "with lightly():\n"
        "    import robotrue.web.server\n"
        f"print([name for name in {heavy.split()!r} if name in sys.modules])"
    )
    found = subprocess.run(  # noqa: S603
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True
    )
    assert found.stdout.strip() == "[]"
