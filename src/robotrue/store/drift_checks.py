"""Drift checks in the store: a few poses against a model, and what they say of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robotrue.store import items
from robotrue.store.nouns import DRIFT_CHECK
from robotrue.store.records import DriftCheckRecord, Link, Ref
from robotrue.store.workspace import Transaction, Workspace


def add(
    where: Workspace | Transaction,
    *,
    name: str,
    model: Ref,
    data: Ref,
    poses: int,
    statistic: float,
    p_value: float,
    verdict: str,
    detail: Mapping[str, Any] | None = None,
    note: str = "",
) -> DriftCheckRecord:
    """Returns a drift check taken in.

    Args:
        where: Workspace or transaction.
        name: In the workspace.
        model: That was checked.
        data: The poses it was checked with.
        poses: How many.
        statistic: Chi-square.
        p_value: Of it under the stored model.
        verdict: keep, update or recalibrate.
        detail: What else the check says, JSON values.
        note: Of the user.

    Raises:
        ConfigurationError: Model or data are not in the workspace.
    """
    columns = {
        "name": name,
        "note": note,
        "detail": dict(detail or {}),
        "poses": poses,
        "statistic": statistic,
        "p_value": p_value,
        "verdict": verdict,
    }
    links = (Link(role="model", to=model), Link(role="data", to=data))
    return items.insert(where, DRIFT_CHECK, columns, links=links)
