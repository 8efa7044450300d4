"""Registry of terms. A new term adds itself with :func:`register`.

A package outside registers its own by an entry point of the group ``robotrue.terms`` that names the
class; it is imported when a fit or an archive first needs terms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.error_vector import (
    without_compliance,
    without_gear,
    without_geometry,
)
from robotrue.calibration.terms.rail_guide import RailGuide
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.rotary_table import RotaryTable
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import MeanTables, Term
from robotrue.calibration.terms.thermal import Thermal
from robotrue.core.extensions import load_extensions, refuse_extension
from robotrue.errors import ArchiveError, ConfigurationError

GROUP: Final = "robotrue.terms"
"""Entry points of packages outside."""
STANDARD: Final = (Ripple.name, Backlash.name, SmoothResidual.name)
"""Terms that every model has, if only with no parameters; their columns come in this order."""
_TERMS: Final[dict[str, type[Term]]] = {
    term.name: term for term in (Ripple, Backlash, SmoothResidual, Thermal, RailGuide, RotaryTable)
}


@cache
def load_outside() -> None:
    """Registers the terms of packages outside, once.

    Raises:
        ConfigurationError: A package registers what is no term, or a name twice.
    """
    for value, term in load_extensions(GROUP, type):
        if not issubclass(term, Term):
            raise refuse_extension(GROUP, value, f"is {term.__name__}, expected a subclass of Term")
        if _TERMS.setdefault(term.name, term) is not term:
            raise refuse_extension(GROUP, value, f"is a second term {term.name!r}")


def register(term: type[Term]) -> None:
    """Adds a term: fits try it where :meth:`Term.begin` offers it, archives restore it.

    Raises:
        ConfigurationError: The name is taken.
    """
    if _TERMS.setdefault(term.name, term) is not term:
        raise ConfigurationError(f"there is an error term {term.name!r} already.")


def unregister(name: str) -> None:
    """Removes a term that is not of the standard set."""
    if name not in STANDARD:
        _TERMS.pop(name, None)


def term_of(name: str) -> type[Term]:
    """Returns the term of a name.

    Raises:
        ArchiveError: It is not registered.
    """
    load_outside()
    if name not in _TERMS:
        raise ArchiveError(
            f"an error term {name!r}; terms are {sorted(_TERMS)}.",
            hint="update robotrue, or import the module that registers the term.",
        )
    return _TERMS[name]


def further_terms() -> tuple[type[Term], ...]:
    """Returns the terms beyond the standard set, in the order they were registered."""
    load_outside()
    return tuple(term for name, term in _TERMS.items() if name not in STANDARD)


def export_parts() -> Mapping[str, Callable[[MeanTables], MeanTables]]:
    """Returns what an export may leave out, by name, and how tables lose it."""
    load_outside()
    return {
        "geometry": without_geometry,
        "gear": without_gear,
        "compliance": without_compliance,
        **{t.export_name: t.out_of_tables for t in _TERMS.values() if t.export_name},
    }
