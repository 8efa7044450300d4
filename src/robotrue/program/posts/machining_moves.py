"""Content of a machining program before any language: joint moves, paths, speeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robotrue.core.arm_words import WORDS, Maker
from robotrue.core.arrays import Array, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError
from robotrue.program.compensation_defaults import BLEND_MM
from robotrue.program.toolpath import FASTEST, Toolpath


@dataclass(frozen=True, slots=True, kw_only=True)
class JointMoves(Columns):
    """Postures that are driven to one after the other, axis by axis.

    Attributes:
        axes: (k, 6) rad, controller's axes.
        T_base_tool: (k, 4, 4) m, of the tool there.
        words: (k, w) configuration words, see :mod:`robotrue.core.arm_words`.
    """

    axes: Annotated[Array, Column("k 6", unit="rad")]
    T_base_tool: Annotated[Array, Column("k 4 4", unit="m")]
    words: Annotated[IntArray, Column("k w")]

    def __len__(self) -> int:
        return len(self.axes)


@dataclass(frozen=True, slots=True, kw_only=True)
class SideMoves(Columns):
    """One side: how to get there, and its path.

    Attributes:
        before: Driven before the path.
        path: In the part frame.
        rotation: (n, 3, 3) of the tool frame in the part.
        words: (n, w) configuration words.
        T_base_part: (4, 4) m, the work frame.
    """

    before: JointMoves
    path: Toolpath
    rotation: Annotated[Array, Column("n 3 3")]
    words: Annotated[IntArray, Column("n w")]
    T_base_part: Annotated[Array, Column("4 4", unit="m")]

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(n=len(self.path))


@dataclass(frozen=True, slots=True, kw_only=True)
class JobSpeeds:
    """Speeds that a tool path does not state.

    Attributes:
        rapid: m/s of rapid points.
        feed: m/s of points that cut before any feed is stated; NaN refuses them.
        joint: Per cent of the axis speeds, for joint moves.
        blend: m, how near to a point that is passed the tool must come; 0 stops at every point.
    """

    rapid: float = 0.2
    feed: float = np.nan
    joint: int = 10
    blend: float = BLEND_MM * MM

    def __post_init__(self) -> None:
        """Refuses what the controller would.

        Raises:
            ConfigurationError: A speed or blend out of range.
        """
        feed = 1e-3 if np.isnan(self.feed) else self.feed
        if not (0.0 < self.rapid <= FASTEST and 0.0 < feed <= FASTEST):
            raise ConfigurationError(
                f"rapid {self.rapid / MM:g} mm/s, feed {self.feed / MM:g} mm/s: expected above 0 "
                f"and at most {FASTEST / MM:g} mm/s."
            )
        if not 1 <= self.joint <= 100 or not 0.0 <= self.blend <= 0.1:
            raise ConfigurationError(
                f"joint speed {self.joint} %, blend {self.blend / MM:g} mm: expected 1 to 100 % "
                "and 0 to 100 mm."
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class MachiningMoves(Columns):
    """A whole program.

    Attributes:
        name: Of the program.
        T_flange_tool: (4, 4) m, the tool that cuts.
        sides: In the order they are cut.
        after: Driven after the last side.
        words_of: Whose configuration words the moves carry.
        speeds: Rapid, joint and default feed.
        remarks: Comments for the head.
    """

    name: str
    T_flange_tool: Annotated[Array, Column("4 4", unit="m")]
    sides: tuple[SideMoves, ...]
    after: JointMoves
    words_of: Maker
    speeds: JobSpeeds
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Checks shapes and values."""
        self._check_columns(w=WORDS[self.words_of])
