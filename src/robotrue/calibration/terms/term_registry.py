"""Which terms there are. A new one adds itself here with :func:`register`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from robotrue.calibration.mean_tables import MeanTables
from robotrue.calibration.terms.backlash import Backlash
from robotrue.calibration.terms.compliance import without_compliance
from robotrue.calibration.terms.geometry import without_gear, without_geometry
from robotrue.calibration.terms.ripple import Ripple
from robotrue.calibration.terms.smooth import SmoothResidual
from robotrue.calibration.terms.term import Term
from robotrue.errors import ArchiveError, ConfigurationError

STANDARD: Final = (Ripple.name, Backlash.name, SmoothResidual.name)
"""Terms that every model has, if only with no parameters; their columns come in this order."""
_TERMS: Final[dict[str, type[Term]]] = {
    term.name: term for term in (Ripple, Backlash, SmoothResidual)
}


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
        ArchiveError: Nobody registered it.
    """
    if name not in _TERMS:
        raise ArchiveError(
            f"an error term {name!r}; terms are {sorted(_TERMS)}.",
            hint="update robotrue, or import the module that registers the term.",
        )
    return _TERMS[name]


def further_terms() -> tuple[type[Term], ...]:
    """Returns the terms beyond the standard set, in the order they were registered."""
    return tuple(term for name, term in _TERMS.items() if name not in STANDARD)


def export_parts() -> Mapping[str, Callable[[MeanTables], MeanTables]]:
    """Returns what an export may leave out, by name, and how tables lose it."""
    return {
        "geometry": without_geometry,
        "gear": without_gear,
        "compliance": without_compliance,
        **{t.export_name: t.out_of_tables for t in _TERMS.values() if t.export_name},
    }
