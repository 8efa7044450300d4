"""Programs written by a seed: the pieces every language shares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.program.program import FrameTable

RATIOS = np.array([1000.0, -1200.0, 1100.0, 800.0, -700.0, 500.0])
FRAME = pose_from_xyz_abc(np.array([900.0, -200.0, 300.0]) * MM, np.array([15.0, -4.0, 8.0]) * DEG)
TABLE = FrameTable(
    bases={"1": FRAME, "2": np.eye(4), "wobj2": FRAME},
    tools={"1": FRAME, "2": np.eye(4), "tool2": FRAME},
    pulses_per_degree=RATIOS,
)


@dataclass(frozen=True)
class Job:
    """Files of one job, the one with the motions first, and how finely its numbers are printed.

    ``place`` is half of the coarsest last digit of a coordinate in m, ``turn`` what half a last
    digit of every number of an attitude makes at most, in elements of a rotation matrix, infinite
    where the language does not print attitudes in full; ``bend`` half a last digit of an axis in
    rad. ``via`` is False where arcs are printed by centre or radius: what lies between is implied.
    What robotrue prints has at least three decimals of mm and deg.
    """

    files: tuple[tuple[str, bytes], ...]
    place: float
    turn: float
    bend: float
    frames: FrameTable = TABLE
    via: bool = True


Writer = Callable[["Pen"], Job]


@dataclass
class Pen:
    """Writes numbers, blanks and words as its generator of random numbers decides."""

    rng: np.random.Generator
    decimals: int = 3
    turns: int = 3
    odd: bool = True
    end: str = "\n"
    mark: bytes = b""
    values: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, seed: int | list[int]) -> Pen:
        """A pen with habits of its own: decimals, line ends, mark."""
        rng = np.random.default_rng(seed)
        return cls(
            rng=rng,
            decimals=int(rng.integers(3, 8)),
            turns=int(rng.integers(3, 9)),
            odd=bool(rng.random() < 0.7),
            end="\r\n" if rng.random() < 0.5 else "\n",
            mark=b"\xef\xbb\xbf" if rng.random() < 0.15 else b"",
        )

    def chance(self, share: float) -> bool:
        """True in this share of cases."""
        return bool(self.rng.random() < share)

    def pick(self, *options: str) -> str:
        """One of the options."""
        return options[int(self.rng.integers(len(options)))]

    def whole(self, low: int, high: int) -> int:
        """A whole number from low to high, both possible."""
        return int(self.rng.integers(low, high + 1))

    def number(self, size: float, decimals: int) -> str:
        """A number printed with some decimals, now and then in another manner of the same value."""
        value = float(self.rng.uniform(-size, size))
        if self.odd and self.chance(0.12):
            value = float(self.rng.choice([0.0, -0.0, 0.5, -0.25, 1.0, size]))
        text = f"{value:.{decimals}f}"
        if not self.odd or self.chance(0.85):
            return text
        manner = self.whole(0, 3)
        if manner == 0 and not text.startswith("-"):
            return "+" + text
        if manner == 1 and text.lstrip("-").startswith("0."):
            return text.replace("0.", ".", 1)
        if manner == 2 and text.lstrip("-0.") == "":
            return "-" + text.lstrip("-")
        return text

    def place(self) -> str:
        """A coordinate in mm."""
        return self.number(2500.0, self.decimals)

    def angle(self) -> str:
        """An angle in deg."""
        if self.chance(0.15):
            return self.pick("90", "-90", "180", "-180", "0") + "." + "0" * self.turns
        return self.number(180.0, self.turns)

    def blank(self) -> str:
        """Blanks, most often one."""
        return self.pick(" ", " ", " ", "  ", "\t", "   ")

    def gap(self) -> str:
        """Blanks or none."""
        return self.pick("", "", "", " ", "  ")

    def case(self, word: str) -> str:
        """The word in some case."""
        return self.pick(word, word, word.lower(), word.title())

    def encode(self, lines: list[str], *, mark: bool = True) -> bytes:
        """The bytes of the lines, with or without a last line end."""
        text = self.end.join("\n".join(lines).split("\n")) + self.pick("", self.end)
        if mark and self.mark:
            return self.mark + text.encode("utf-8")
        return text.encode("latin-1")

    def abc_job(self, *files: tuple[str, bytes], scale: float = MM) -> Job:
        """A job of coordinates and three angles with the decimals of this pen."""
        turn = 0.5 * 10.0**-self.turns * DEG
        return Job(
            files=files,
            place=0.5 * 10.0**-self.decimals * scale,
            turn=3.0 * turn,
            bend=turn,
        )
