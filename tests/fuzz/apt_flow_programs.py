"""CL data of steps, arcs, cycles and moved coordinates, by a seed; for ``apt_controller``.

Not written: words that posts read in different ways (MODE/INCR, MOVARC, longer CIRCLE records,
RETRCT, subroutines), and what makes APT source of it: MACRO, LOOPST and names need signs that the
reader refuses as no statement of CL data.
"""

from __future__ import annotations

import numpy as np
from written import Pen

from robotrue.core.rotations import matrix_from_abc


class AptFlowWriter:
    """Writes one file."""

    def __init__(self, pen: Pen) -> None:
        self.pen = pen
        self.calm = pen.chance(0.5)
        self.inch = pen.chance(0.2)
        self.five = pen.chance(0.7)

    def job(self) -> dict[str, str]:
        """The file of a job by name."""
        pen = self.pen
        lines = ["PARTNO A", "$$ MADE BY"] if pen.chance(0.5) else []
        lines += self._system() if pen.chance(0.3) else []
        lines += ["UNITS/INCHES" if self.inch else pen.pick("UNITS/MM", "UNITS / MM")]
        lines += [f"LOADTL/{pen.pick('T1', 'T2', '9')}"] if pen.chance(0.7) else []
        lines += [pen.pick("MULTAX", "MULTAX/ON")] if self.five and pen.chance(0.7) else []
        if pen.chance(0.4):
            lines.append(f"FROM/{self._point()}{self._axis() if self.five else ''}")
        for _ in range(pen.whole(4, 20)):
            lines += self._statement()
        return {"part.apt": "\n".join([*lines, "FINI"]) + "\n"}

    def _number(self, size: float = 900.0) -> str:
        decimals = 6 if self.inch else self.pen.whole(3, 6)
        size = size / 25.4 if self.inch else size
        text = f"{self.pen.rng.uniform(-size, size):{self.pen.pick('', '12')}.{decimals}f}"
        return text

    def _point(self) -> str:
        return ",".join(self._number() for _ in range(3))

    def _axis(self) -> str:
        v = self.pen.rng.normal(size=3) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
        begin = self.pen.pick(",", ", ", ",$\n  ", ", $$ axis\n".replace(" $$ axis", "$"))
        return begin + ",".join(f"{value:.7f}" for value in v / np.linalg.norm(v))

    def _goto(self) -> str:
        head = self.pen.pick("GOTO/", "GOTO/", "GOTO  /  ", "goto/")
        tail = self.pen.pick("", "", " $$ GOTO/1,2,3")
        axis = self._axis() if self.five and self.pen.chance(0.6) else ""
        return f"{head}{self._point()}{axis}{tail}"

    def _system(self) -> list[str]:
        T = matrix_from_abc(self.pen.rng.uniform(-1.0, 1.0, 3))
        rows = [f"$$ {' '.join(f'{v:.5f}' for v in row)} {self._number().strip()}" for row in T]
        return ["$$*CATIA0", "$$Axis 1", *rows]

    def _statement(self) -> list[str]:
        pen, kind = self.pen, self.pen.whole(0, 27)
        if self.calm and kind >= 14 and pen.chance(0.7):
            kind = 0
        if kind <= 8:
            return [self._goto()]
        if kind == 9:
            return [pen.pick("RAPID", "FEDRAT/ 300.0,MMPM", "FEDRAT/12.0", "SPINDL/ 900.0,RPM,CLW"),
                    self._goto()]  # fmt: skip
        if kind == 10:
            return [pen.pick("PPRINT GOTO/1,2,3", "$$ GOTO/1,2,3", "REMARK TRANS/1,2,3", "", "  ",
                             "INSERT X1", "COOLNT/ON")]  # fmt: skip
        if kind <= 12:
            axis = self._axis() if self.five and pen.chance(0.25) else ""
            return [pen.pick(f"GODLTA/{self._point()}{axis}", f"GODLTA/{self._number(20.0)}")]
        if kind == 13:
            return [f"FROM/{self._point()}{self._axis() if self.five and pen.chance(0.6) else ''}"]
        if kind <= 15:
            return self._arc()
        return self._odd(kind)

    def _arc(self) -> list[str]:
        """A point, a circle through it, and the end of the arc."""
        unit = 25.4 if self.inch else 1.0
        centre, radius = self.pen.rng.uniform(-300.0, 300.0, 3), self.pen.rng.uniform(5.0, 80.0)
        one, two = self.pen.rng.uniform(0.0, 6.0, 2)

        def shown(values: np.ndarray) -> str:
            return ",".join(f"{value / unit:.6f}" for value in values)

        ends = [centre + radius * np.array([np.cos(a), np.sin(a), 0.0]) for a in (one, two)]
        lines = [f"GOTO/{shown(ends[0])}", f"CIRCLE/{shown(centre)},0,0,1,{radius / unit:.6f}"]
        return [*lines, f"GOTO/{shown(ends[1])}", *([self._goto()] if self.pen.chance(0.6) else [])]

    def _odd(self, kind: int) -> list[str]:
        pen, inner = self.pen, [self._goto() for _ in range(self.pen.whole(1, 3))]
        if kind <= 17:
            return ["CYCLE/DRILL,5.0,MMPM,100.0", *inner, pen.pick("CYCLE/OFF", "CYCLE/NOMORE")]
        if kind == 18:
            return ["CUTCOM/LEFT", *inner, "CUTCOM/OFF"]
        if kind == 19 and self.five:
            self.five = False  # a locked axis is not written again
            inner = [self._goto() for _ in range(pen.whole(1, 3))]
            self.five = True
            return ["MULTAX/OFF", *inner, "MULTAX/ON"]
        if kind == 20 and self.five:
            v = pen.rng.normal(size=3) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
            axis = ",".join(f"{value:.7f}" for value in v / np.linalg.norm(v))
            return [f"TLAXIS/{axis}", f"GOTO/{self._point()}"]
        if kind <= 22:
            return [f"LOADTL/{pen.pick('T1', 'T1', 'T2', '9')}", self._goto()]
        if pen.chance(0.5):
            return inner
        if kind == 23:
            return [f"TRANS/{self._point()}", *inner, pen.pick("TRANS/0,0,0", "RAPID")]
        if kind == 24:
            T = matrix_from_abc(pen.rng.uniform(-1.0, 1.0, 3))
            rows = ",".join(",".join([*(f"{v:.6f}" for v in row), self._number()]) for row in T)
            return [f"TRACUT/{rows}", *inner, pen.pick("TRACUT/NOMORE", "RAPID")]
        if kind == 25:
            return ["INDEX/1", *inner, f"COPY/1,TRANSL,{self._point()},{pen.whole(1, 2)}"]
        return [*self._system(), *inner] if kind == 26 else inner
