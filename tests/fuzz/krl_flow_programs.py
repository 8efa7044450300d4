"""KRL programs of branches, loops, calls and stored points, by a seed; for ``krl_controller``."""

from __future__ import annotations

from written import Pen

FRAMES = ("off1", "off2")
SETS_FRAMES = ("BAS", "$BASE", "$TOOL")


class FlowWriter:
    """Writes one job."""

    def __init__(self, pen: Pen) -> None:
        self.pen, self.labels = pen, 0
        self.points = [f"xp{k}" for k in range(1, pen.whole(2, 5))]
        self.routines = [f"sub{k}" for k in range(pen.whole(0, 2))]
        self.local: list[str] = []
        self.shared = [f"gp{k}" for k in range(pen.whole(1, 3))] if pen.chance(0.35) else []
        self.points += self.shared

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        pen = self.pen
        own = [point for point in self.points if point not in self.shared]
        kinds = [f"DECL {pen.pick('E6POS', 'FRAME', 'POS')} {p}={self._pose()}" for p in own]
        data = [
            "DEFDAT part PUBLIC", *kinds,
            *(f"DECL GLOBAL FRAME {f}={self._pose(80.0)}" for f in FRAMES),
            "DECL FRAME arr[2]", f"arr[1]={self._pose()}", f"arr[2]={self._pose()}",
            "DECL GLOBAL INT n=1", "DECL GLOBAL INT nb=1", "INT i=0", "DECL GLOBAL REAL clear=50.0",
            "ENDDAT",
        ]  # fmt: skip
        body = ["DEF part( )"]
        if pen.chance(0.4):
            self.local = ["loc"]
            body += ["DECL FRAME loc", f"loc={self._pose()}"]
        if pen.chance(0.8):
            body += ["BAS(#TOOL,1)", "BAS(#BASE,1)"]
        body += [*self._block(2, "", pen.whole(3, 9)), "END"]
        self.local = []
        for number, name in enumerate(self.routines):
            barred = ("sub", "INTERRUPT", "TRIGGER", *(SETS_FRAMES if not number else ()))
            lines = self._block(1, "n", pen.whole(1, 3))
            body += [f"DEF {name}( )", *(x for x in lines if not x.startswith(barred)), "END"]
        body += [*self._by_reference(), *self._by_value()]
        files = {"part.src": body, "part.dat": data, **(self._other() if self.shared else {})}
        return {name: "\n".join(lines) + "\n" for name, lines in files.items()}

    def _other(self) -> dict[str, list[str]]:
        """Another program with the points that both use."""
        points, self.points, self.routines = self.points, self.shared, []
        lines = [x for x in self._block(1, "n", self.pen.whole(1, 4)) if "arr" not in x]
        lines = [x for x in lines if not x.startswith(("by", "INTERRUPT", "TRIGGER"))]
        self.points = points
        data = [f"DECL GLOBAL E6POS {point}={self._pose()}" for point in self.shared]
        return {
            "other.src": ["DEF other( )", *lines, "END"],
            "other.dat": ["DEFDAT other PUBLIC", *data, "ENDDAT"],
        }

    def _by_reference(self) -> list[str]:
        pose = self._pose()
        choice = self.pen.pick(
            "LIN q", "q.Z=q.Z+7\nLIN q", f"q={pose}", f"q={pose}\nLIN q", f"LIN {pose}", "q.X=64.25"
        )
        return ["DEF bypar(q:OUT )", "E6POS q", *choice.split("\n"), "END"]

    def _by_value(self) -> list[str]:
        choice = self.pen.pick("LIN q", "q.Z=q.Z+20\nLIN q", "LIN q:off1")
        return ["DEF byval(q:IN )", "E6POS q", *choice.split("\n"), "END"]

    def _pose(self, size: float = 1200.0) -> str:
        place = self.pen.rng.uniform(-size, size, 3)
        values = [*place, *self.pen.rng.uniform(-75.0, 75.0, 3)]
        return "{" + ",".join(f"{n} {v:.3f}" for n, v in zip("XYZABC", values, strict=True)) + "}"

    def _point(self) -> str:
        return self.pen.pick(*self.points, *self.points, *self.local)

    def _number(self, counter: str) -> str:
        if self.pen.chance(0.12):
            return "$ANIN[1]"
        fixed = f"{self.pen.rng.uniform(-90.0, 90.0):.2f}"
        counted = (f"{counter}*{self.pen.whole(5, 40)}.5",) if counter else ()
        other = f"{self._point()}.x+{self.pen.whole(1, 60)}"
        return self.pen.pick(fixed, fixed, "clear", "2*clear", other, *counted)

    def _target(self, counter: str) -> str:
        kind = self.pen.whole(0, 10)
        if kind <= 3:
            return self._pose()
        if kind <= 7:
            return self._point()
        if kind == 8:
            return f"arr[{self.pen.pick('1', '2', 'n', *([counter] if counter else []))}]"
        pair = [self._point(), self.pen.pick(*FRAMES)]
        return ":".join(pair if kind == 9 else pair[::-1])

    def _block(self, depth: int, counter: str, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 5)
        return [line for _ in range(count) for line in self._statement(depth, counter)]

    def _statement(self, depth: int, counter: str) -> list[str]:
        kind = self.pen.whole(0, 27)
        if kind <= 8:
            return [f"{self.pen.pick('LIN', 'LIN', 'LIN', 'PTP')} {self._target(counter)}"]
        if kind == 9:
            return [f"CIRC {self._pose()},{self.pen.pick(self._pose(), self._point())}"]
        if kind <= 16:
            return [self._setting(kind, counter)]
        return self._structure(kind, depth, counter) if depth else [f"LIN {self._point()}"]

    def _setting(self, kind: int, counter: str) -> str:
        pen, point = self.pen, self._point()
        if kind <= 11:
            return pen.pick(
                f"BAS(#BASE,{pen.whole(1, 2)})", f"BAS(#TOOL,{pen.whole(1, 2)})",
                f"$BASE=BASE_DATA[{pen.pick('1', '2', 'nb')}]", f"$BASE={self._pose(300.0)}",
                f"$TOOL=TOOL_DATA[{pen.whole(1, 2)}]", f"$BASE=BASE_DATA[1]:{pen.pick(*FRAMES)}",
                "$BASE=$NULLFRAME",
            )  # fmt: skip
        if kind <= 13 and pen.chance(0.06):
            side, number = pen.pick("BASE", "BASE", "TOOL"), pen.pick("1", "1", "2", "nb")
            return f"{side}_DATA[{number}]={self._pose(300.0)}"
        if kind <= 13:
            return f"{point}.{pen.pick(*'XYZA')}={self._number(counter)}"
        if kind == 14:
            moved = f"{self._point()}:{pen.pick(*FRAMES)}"
            return f"{point}={pen.pick(self._point(), self._pose(), moved)}"
        if kind == 15:
            return f"{pen.pick(*FRAMES)}.{pen.pick(*'XYZ')}={self._number(counter)}"
        return pen.pick(
            "n=2", "n=1", "nb=2", "nb=1", "clear=40.0", "clear=clear+1.0", f"arr[2]={point}",
            f"arr[{pen.whole(1, 2)}].x={self._number(counter)}",
        )  # fmt: skip

    def _structure(self, kind: int, depth: int, counter: str) -> list[str]:
        pen, one = self.pen, self._block(depth - 1, counter)
        two = self._block(depth - 1, counter)
        if kind <= 18:
            condition = pen.pick("$IN[1]", "n==2", "$IN[2]", "clear>45.0")
            other = ["ELSE", *two] if pen.chance(0.5) else []
            return [f"IF {condition} THEN", *one, *other, "ENDIF"]
        if kind == 19 and not counter:
            return ["FOR i=1 TO 2", *self._block(depth - 1, "i"), "ENDFOR"]
        if kind == 20:
            return ["WHILE $IN[3]", *one, "ENDWHILE"]
        if kind == 21:
            return ["LOOP", *one, "IF $IN[4] THEN", "EXIT", "ENDIF", *two, "ENDLOOP"]
        if kind == 22:
            return ["REPEAT", *one, f"UNTIL {pen.pick('$IN[5]', 'TRUE')}"]
        if kind == 23:
            self.labels += 1
            name = f"lab{self.labels}"
            jump = ["IF $IN[6] THEN", f"GOTO {name}", "ENDIF"]
            return [*jump, *self._block(0, counter), f"{name}:"]
        if kind == 24:
            other = ["DEFAULT", f"LIN {self._pose()}"] if pen.chance(0.5) else []
            return ["SWITCH n", "CASE 1", *one, "CASE 2", *two, *other, "ENDSWITCH"]
        if kind == 25:
            return [pen.pick(*(f"bypar({p})" for p in self.points), f"byval({self._pose()})")]
        if self.shared and depth > 1 and self.pen.chance(0.5):
            return ["other()"]
        if not self.routines:
            return [f"byval({self._point()})"]
        first = self.routines[0]
        if kind == 26:
            return [f"{pen.pick(*self.routines)}()"]
        return pen.pick(
            f"INTERRUPT DECL 5 WHEN $IN[9] DO {first}()\nINTERRUPT ON 5", "INTERRUPT OFF 5",
            f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO {first}() PRIO=-1\nLIN {self._pose()}",
        ).split("\n")  # fmt: skip
