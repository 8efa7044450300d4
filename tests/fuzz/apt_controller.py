"""Follows the CL data of ``apt_flow_programs`` as a post does, without the product.

Written from the statements of CATIA, Creo and the APT post processors: a tool axis holds until the
next, that of FROM too; MULTAX/OFF locks the last one; GODLTA with three numbers or six is a step,
with one a step along the axis. TRANS, TRACUT and COPY move what comes after, or repeat it. An arc
begins on its circle or the post refuses it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from controllers import Ended, Move

from robotrue.core.units import MM

UNITS = {"MM": 1.0, "INCHES": 25.4}
MISS = 0.02
FREE = ("PARTNO", "PPRINT", "INSERT", "REMARK", "TPRINT")


class AptController:
    """One file.

    Args:
        files: Its text by name.
        frames: Tools of the cell by number, and its work frame; the empty name: without any.
        rng: Decides nothing.
    """

    def __init__(
        self,
        files: Mapping[str, str],
        frames: Mapping[str, Mapping[str, np.ndarray]],
        rng: np.random.Generator,
    ) -> None:
        self.frames, self.moves = frames, list[Move]()
        (text,) = files.values()
        self.statements: list[str] = []
        pending = ""
        for line in text.splitlines():
            code = line.partition("$$")[0].strip()
            if line.strip().startswith("$$*") or "$$ M" in line:
                self.statements.append(line.strip())
            pending += code.removesuffix("$").strip()
            if not code.endswith("$"):
                self.statements.append(pending)
                pending = ""

    def run(self) -> bool:
        """Follows the file; returns whether it came to its end."""
        self.unit, self.tool = 1.0, ""
        self.here, self.axis = np.full(3, np.nan), np.array([0.0, 0.0, 1.0])
        self.stated = self.locked = False
        self.moved: dict[str, np.ndarray] = {}
        self.circle: np.ndarray | None = None
        self.marks: dict[str, int] = {}
        self.systems = 0
        try:
            for statement in self.statements:
                self._take(statement)
        except Ended:
            return False
        return True

    def _take(self, line: str) -> None:
        if line.startswith("$$*"):
            self.systems += 1
        head, _, rest = (part.strip() for part in line.upper().partition("/"))
        if head.startswith(FREE):
            return
        words = [word.strip() for word in rest.split(",")] if rest else []
        if head in ("GOTO", "GODLTA", "FROM"):
            self._go(head, np.array([float(word) for word in words]))
        elif head == "UNITS":
            self.unit = UNITS[words[0]]
        elif head == "MULTAX":
            self.locked = words == ["OFF"]
        elif head == "TLAXIS":
            self.axis, self.stated = np.array([float(word) for word in words]), False
        elif head in ("LOADTL", "TOOLNO"):
            self.tool = words[0]
        elif head == "CIRCLE":
            self.circle = np.array([float(word) for word in words])
        elif head == "TRANS":
            T = np.eye(4)
            T[:3, 3] = [float(word) * self.unit for word in words]
            self.moved[head] = T
        elif head == "TRACUT":
            self.moved.pop(head, None)
            if words != ["NOMORE"]:
                T = np.eye(4)
                T[:3] = np.reshape([float(word) for word in words], (3, 4))
                T[:3, 3] *= self.unit
                self.moved[head] = T
        elif head == "INDEX":
            self.marks[words[0]] = len(self.moves)
        elif head == "COPY":
            step = np.array([float(word) for word in words[2:5]]) * self.unit * MM
            repeated = self.moves[self.marks[words[0]] :]
            for k in range(1, int(words[5]) + 1):
                for each in repeated:
                    assert each.target is not None
                    target = each.target.copy()
                    target[:3, 3] += k * step
                    self.moves.append(each._replace(target=target))

    def _go(self, head: str, values: np.ndarray) -> None:
        step = values if head == "GODLTA" else np.zeros(0)
        if len(values) == 6:
            self.axis, self.stated = values[3:] / np.linalg.norm(values[3:]), True
        point = values[:3] * self.unit
        if head == "GODLTA":
            point = self.here + (point if len(values) > 1 else point * self.axis)
        if self.circle is not None and head == "GOTO":
            away = self.here - self.circle[:3] * self.unit
            away -= (away @ self.circle[3:6]) * self.circle[3:6]
            if abs(np.linalg.norm(away) - self.circle[6] * self.unit) > MISS:
                raise Ended
            self.circle = None
        self.here = point
        if head == "FROM":
            return
        if not np.isfinite(point).all():
            raise Ended
        T = np.eye(4)
        T[:3, 3] = point
        z = -self.axis
        x = np.cross([0.0, 1.0, 0.1], z)
        x /= np.linalg.norm(x)
        T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        for each in self.moved.values():
            T[:3, 3] = (each @ T[:, 3])[:3]
        T[:3, 3] *= MM
        tools, base = self.frames["tool"], self.frames["base"][""]
        self.moves.append(
            Move(
                base if self.systems < 2 else np.eye(4), tools.get(self.tool, tools[""]), T,
                via=not self.stated or self.locked, follows=head == "GODLTA", step=step, told=(2,),
            )
        )  # fmt: skip
