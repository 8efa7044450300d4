"""Where what a stored item holds comes from, told by its record alone."""

from __future__ import annotations

from collections.abc import Mapping

from robotrue.core.provenance import Provenance, provenance_from
from robotrue.store.records import Record


def provenance_of_record(record: Record) -> Provenance:
    """Returns the provenance in the detail of a record; measured, where it says nothing of it.

    Raises:
        ArchiveError: The detail holds something else in its place.
    """
    detail = record.detail
    session = detail.get("session")
    stated = session if isinstance(session, Mapping) else detail
    if detail.get("provenance") is None and isinstance(stated.get("simulated"), bool):
        return Provenance(simulated=stated["simulated"])
    steps = [name for step in detail.get("history", ()) for name in step.get("sources", ())]
    before = (*detail.get("sources", ()), *detail.get("groups", ()), *steps)
    return provenance_from(detail.get("provenance"), before=before)
