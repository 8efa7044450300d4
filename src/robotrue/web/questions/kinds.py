"""Which jobs can be asked for."""

from __future__ import annotations

from importlib import import_module

from robotrue.web.questions.packing import answer


def known(kinds: str) -> bytes:
    """Returns the names of the kinds at ``module:name``."""
    module, _, name = kinds.partition(":")
    return (
        answer({"kinds": sorted(getattr(import_module(module), name))})
        if kinds
        else b'{"kinds":[]}'
    )
