"""Warnings of a model for a reader: one line per cure, with what it costs a prediction."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from robotrue.calibration.model import ErrorModel
from robotrue.calibration.training_summary import Unseen
from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.robot.forward import parameter_jacobian, walk
from robotrue.robot.model import parameter_names

PREFIX: Final = "not seen by the data: "
"""How a fit begins a warning about a combination of parameters."""
NAMED: Final = 2
"""Combinations a grouped warning names; it counts the others."""
REGION: Final = "inside the region of the poses"
POSES: Final = 64
"""Postures drawn inside the joint ranges of a model to learn what a warning costs there."""


def group_warnings(model: ErrorModel, warnings: Sequence[str]) -> list[str]:
    """Returns the warnings of a model with those of one cure in one line, in their order.

    Args:
        model: Its summary lists the undetermined combinations of parameters.
        warnings: Sentences, as the summary or a validation lists them.
    """
    return [line for line, _ in _group_lines(model, warnings)]


def count_warnings(model: ErrorModel, warnings: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Returns the same warnings with combinations counted, not named, and with their names."""
    return [
        (line.replace(_name_group(group), _count(group), 1), [each.name for each in group])
        if group
        else (line, [])
        for line, group in _group_lines(model, warnings)
    ]


def _group_lines(
    model: ErrorModel, warnings: Sequence[str]
) -> Iterator[tuple[str, Sequence[Unseen]]]:
    """Yields each line with the combinations that it is about, if any."""
    unseen = {f"{PREFIX}{each.name}: {each.cure}.": each for each in _list_harmful(model)}
    by_cure = _group_by_cure(unseen[line] for line in warnings if line in unseen)
    described = _describe_groups(model, by_cure)
    for line in warnings:
        if line not in unseen:
            yield line, ()
        elif description := described.pop(unseen[line].cure, ""):
            yield f"{PREFIX}{description}.", by_cure[unseen[line].cure]


def group_unseen(model: ErrorModel) -> list[str]:
    """Returns one line per cure for all combinations that the data could not determine."""
    summary = model.training_summary()
    harmful = _group_by_cure(_list_harmful(model))
    harmless = _group_by_cure(each for each in summary.unseen if each.harmless and each.cure)
    return [
        *_describe_groups(model, harmful).values(),
        *(f"{_name_group(group)}: {cure}" for cure, group in harmless.items()),
    ]


def without_unseen(model: ErrorModel, warnings: Iterable[str]) -> tuple[str, ...]:
    """Returns the warnings that are not about undetermined combinations of parameters."""
    unseen = {f"{PREFIX}{each.name}: {each.cure}." for each in _list_harmful(model)}
    return tuple(line for line in warnings if line not in unseen)


def _list_harmful(model: ErrorModel) -> list[Unseen]:
    return [u for u in model.training_summary().unseen if u.cure and not u.harmless]


def _group_by_cure(unseen: Iterable[Unseen]) -> dict[str, list[Unseen]]:
    groups: dict[str, list[Unseen]] = {}
    for each in unseen:
        groups.setdefault(each.cure, []).append(each)
    return groups


def _name_group(group: Sequence[Unseen]) -> str:
    names = sorted((each.name for each in group), key=len)
    more = len(names) - NAMED
    shown = ", ".join(names[:NAMED] if more > 1 else names)
    return f"{shown}, {more} more combinations" if more > 1 else shown


def _count(group: Sequence[Unseen]) -> str:
    return f"{len(group)} combination{'' if len(group) == 1 else 's'} of parameters"


def _describe_groups(model: ErrorModel, groups: Mapping[str, Sequence[Unseen]]) -> dict[str, str]:
    """What each cure is for, with its cost."""
    directions = [[each.terms for each in group] for group in groups.values()]
    described = {}
    costs = region_costs(model, directions) if directions else []
    for (cure, group), cost in zip(groups.items(), costs, strict=True):
        stated = "" if cost is None else f" (adds {cost / MM:.3f} mm to predictions {REGION})"
        described[cure] = f"{_name_group(group)}{stated}: {cure}"
    return described


def region_costs(
    model: ErrorModel, groups: Sequence[Sequence[Mapping[str, float]]]
) -> list[float | None]:
    """Returns the sd in m (3-D, rms) that groups of directions add inside the region.

    Args:
        model: Its belief and its joint ranges.
        groups: Of each the directions: parameter name to coefficient, SI; any scale.

    Returns:
        None where the model has no belief, no joint range or no such parameter.
    """
    belief, joint_range = model.belief(), model.training_summary().joint_range
    if belief is None or joint_range is None:
        return [None] * len(groups)
    root = belief.root[:, : len(belief.robot.errors)]
    free = np.flatnonzero((root**2).sum(axis=0) > 0.0)
    names = np.array(parameter_names(model.robot.dof))[free].tolist()
    low, high = joint_range
    joints = low + (high - low) * np.random.default_rng(0).random((POSES, len(low)))
    actual = belief.actual
    jacobian = parameter_jacobian(actual, walk(actual, joints), joints)[:, :3, free]
    costs: list[float | None] = []
    for directions in groups:
        if not all(directions) or any(name not in names for terms in directions for name in terms):
            costs.append(None)
            continue
        columns = np.array([[terms.get(name, 0.0) for terms in directions] for name in names])
        moved = jacobian @ _spread_along(root[:, free], columns)
        costs.append(float(np.sqrt((moved**2).sum(axis=(1, 2)).mean())))
    return costs


def _spread_along(root: Array, columns: Array) -> Array:
    """Root (p, k) of the covariance of a belief along some directions, the others held.

    A direction that only the prior holds has the same precision in both: D (D' C^-1 D)^-1 D'.
    """
    sd = np.sqrt((root**2).sum(axis=0))
    _, s, vt = np.linalg.svd(root / sd, full_matrices=False)
    kept = s > 1e-9 * s[0]
    white = (vt[kept] @ (columns / sd[:, None])) / s[kept][:, None]
    scale = np.linalg.pinv(white)  # white' white = D' C^-1 D
    turn, size, _ = np.linalg.svd(scale, full_matrices=False)
    return np.asarray(columns @ turn * size)
