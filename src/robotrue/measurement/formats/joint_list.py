"""What joins a list of points to a list of joints, and how their rows find each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from robotrue.core.document_decoder import decode
from robotrue.errors import ConfigurationError

JoinRule: TypeAlias = Literal["order", "name", "time"]
BESIDE: Final = " (joint list)"
"""Follows the name of a column of the joint list where the points have one of that name."""
FIND: Final = "find"
"""In place of a lag: look for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JointList:
    """A second file that holds the joints: ``[joint_list]`` of a column mapping.

    Attributes:
        file: A table, or lines of a program: RAPID ``jointtarget``, KRL ``E6AXIS``, Fanuc
            positions, URScript lists.
        by: How rows find each other: in their order, by equal names, by the nearest time.
        joint_column: Name or time in the joint list.
        point_column: Name or time in the list of points; empty: called as in the joint list.
        tolerance_s: Farthest two times of one row may lie apart.
        lag_s: The tracker's clock minus the controller's; ``"find"`` looks for it.
        delimiter: Of a table, None finds out.
        decimal: Of a table, None finds out.
        skip_lines: Of a table, lines before its header.
    """

    file: Path
    by: JoinRule = "order"
    joint_column: str = ""
    point_column: str = ""
    tolerance_s: float | None = None
    lag_s: float | str = 0.0
    delimiter: str | None = None
    decimal: str | None = None
    skip_lines: int = 0

    def __post_init__(self) -> None:
        """Checks the rule, and that a join by time states its tolerance.

        Raises:
            ConfigurationError: It does not, or the rule is unknown.
        """
        if self.by not in get_args(JoinRule):
            raise ConfigurationError(
                f"joint_list.by is {self.by!r}, allowed: {', '.join(get_args(JoinRule))}."
            )
        if self.by == "time" and not (self.tolerance_s and self.tolerance_s > 0.0):
            raise ConfigurationError(
                f"joint_list.tolerance_s is {self.tolerance_s}, a join by time needs seconds above "
                "0.",
                hint="half the shortest stop at a pose, for example tolerance_s = 1.0.",
            )
        if isinstance(self.lag_s, str) and self.lag_s != FIND:
            raise ConfigurationError(f"joint_list.lag_s is {self.lag_s!r}, allowed: {FIND!r}.")

    @property
    def keys(self) -> tuple[str, str]:
        """Columns of names or times: in the joint list, and in the list of points."""
        joint = self.joint_column or self.point_column or self.by
        return joint.removesuffix(BESIDE), self.point_column or joint


def build_joint_list(stated: object, source: Path | None) -> JointList:
    """Returns a joint list from its fields by name; its file lies beside ``source``.

    Raises:
        ConfigurationError: An unknown field, or one of a kind it cannot have.
    """
    known = {field.name for field in fields(JointList)}
    if not isinstance(stated, Mapping) or "file" not in stated or set(stated) - known:
        odd = sorted(set(stated) - known) if isinstance(stated, Mapping) else []
        raise ConfigurationError(
            f"joint_list {'has no key ' + repr(odd[0]) if odd else 'names no file'}; "
            f"known are {', '.join(sorted(known))}.",
            source=source,
        )
    values: dict[str, object] = dict(stated)
    folder = Path() if source is None else source.parent
    values["file"] = folder / str(values["file"])
    return decode(JointList, values, key="joint_list", error=ConfigurationError, source=source)
