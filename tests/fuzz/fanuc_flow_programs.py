"""Fanuc LS jobs of branches, loops, calls and registers, by a seed; for ``fanuc_controller``."""

from __future__ import annotations

from written import Pen


class FanucFlowWriter:
    """Writes one job."""

    def __init__(self, pen: Pen) -> None:
        self.pen, self.labels = pen, 0
        self.calm = pen.chance(0.6)
        self.subs = [f"SUB{k}" for k in range(pen.whole(0, 2))]
        self.points, self.axes = 0, set[int]()
        self.frames = pen.pick("1", "1", "2", "F")

    def job(self) -> dict[str, str]:
        """The files of a job by name."""
        frame = self.frames.replace("F", "1")
        begin = [f"UFRAME_NUM={frame}", "UTOOL_NUM=1"] if self.pen.chance(0.85) else []
        out = {"part.ls": self._program("PART", begin, 2, self.pen.whole(3, 10))}
        for name in self.subs:
            begin = [f"UFRAME_NUM={frame}"] if self.pen.chance(0.3) else []
            out[f"{name.lower()}.ls"] = self._program(name, begin, 1, self.pen.whole(1, 4))
        return out

    def _program(self, name: str, begin: list[str], depth: int, size: int) -> str:
        self.points = self.pen.whole(2, 5)
        self.axes = {k for k in range(1, self.points + 1) if self.pen.chance(0.15)} - {1}
        body = begin + self._block(depth, name, size)
        lines = [f"{number:4d}:  {text} ;" for number, text in enumerate(body, 1)]
        records = [self._record(k) for k in range(1, self.points + 1)]
        head = [f"/PROG  {name}", "/ATTR", f"LINE_COUNT\t= {len(body)};",
                "DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]  # fmt: skip
        return "\n".join([*head, *lines, "/POS", *records, "/END"]) + "\n"

    def _record(self, number: int) -> str:
        rng = self.pen.rng
        tool = self.pen.pick("1", "1", self.frames.replace("2", "1"))
        comment = self.pen.pick("", "", ':"home"')
        head = f"P[{number}{comment}]{{\n   GP1:\n\tUF : {self.frames}, UT : {tool},"
        if number in self.axes:
            values = [f"J{k + 1} = {v:.3f} deg" for k, v in enumerate(rng.uniform(-90, 90, 6))]
            return head + "\n\t" + ",\t".join(values) + "\n};"
        values = [
            f"{n} = {v:.3f} mm" for n, v in zip("XYZ", rng.uniform(-1200, 1200, 3), strict=True)
        ]
        values += [
            f"{n} = {v:.3f} deg" for n, v in zip("WPR", rng.uniform(-75, 75, 3), strict=True)
        ]
        return head + "\t\tCONFIG : 'N U T, 0, 0, 0',\n\t" + ",\t".join(values) + "\n};"

    def _place(self) -> str:
        """A position of this program that is no axis value."""
        whole = [f"P[{k}]" for k in range(1, self.points + 1) if k not in self.axes]
        return self.pen.pick(*whole)

    def _register(self) -> str:
        return f"PR[{self.pen.whole(1, 4)}]"

    def _target(self) -> str:
        kind = self.pen.whole(0, 9)
        if kind <= 5:
            return f"P[{self.pen.whole(1, self.points)}]"
        if kind <= 8:
            return self._register()
        return self.pen.pick("PR[R[1]]", "P[R[1]]", self._register())

    def _number(self) -> str:
        fixed = f"{self.pen.rng.uniform(-60.0, 60.0):.2f}".replace("-", "(-") + ")"
        fixed = fixed if fixed.startswith("(") else fixed[:-1]
        return self.pen.pick(
            fixed, fixed, "R[4]", "R[4]*5", "AI[1]", f"{self._register()[:-1]},1]+12",
            f"{self._register()[:-1]},3]+R[4]",
        )  # fmt: skip

    def _move(self) -> str:
        tail = self.pen.pick("", "", "", "", " Offset,PR[10]", " Tool_Offset,PR[11]", " Offset", "")
        word = self.pen.pick("L", "L", "J")
        target = self._target()
        if self.pen.chance(0.06):
            target, tail = self.pen.pick(target, "PR[10]", "PR[11]"), " INC"
        speed = "20%" if word == "J" else "200mm/sec"
        return f"{word} {target} {speed} {self.pen.pick('FINE', 'CNT50')}{tail}"

    def _block(self, depth: int, name: str, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 4)
        return [line for _ in range(count) for line in self._statement(depth, name)]

    def _statement(self, depth: int, name: str) -> list[str]:
        kind, pen = self.pen.whole(0, 26), self.pen
        if self.calm and 11 <= kind <= 17 and pen.chance(0.75):
            kind = 0
        if kind <= 9:
            return [self._move()]
        if kind == 10 and pen.chance(0.4):
            return [f"A {self._target()} 200mm/sec FINE" for _ in range(pen.whole(1, 4))]
        if kind == 10:
            return [f"C {self._place()} {pen.pick(self._place(), self._register())} 200mm/sec FINE"]
        if kind <= 17:
            return [self._setting(kind)]
        if not depth:
            return [f"L {self._place()} 200mm/sec FINE"]
        return self._structure(kind, depth, name)

    def _setting(self, kind: int) -> str:
        pen, place, one = self.pen, self._place(), self._register()
        if kind == 11:
            if self.frames != "F" and pen.chance(0.7):
                return pen.pick(f"UFRAME_NUM={self.frames}", "UTOOL_NUM=1")
            return f"{pen.pick('UFRAME_NUM', 'UTOOL_NUM')}={pen.pick('1', '2', 'R[3]')}"
        if kind <= 13:
            sums = place + "+PR[10]", one + "-PR[10]", "PR[10]+" + place
            return f"{one}={pen.pick(place, place, *sums, self._register(), 'LPOS')}"
        if kind <= 15:
            return f"{one[:-1]},{pen.whole(1, 4)}]={self._number()}"
        if kind == 16:
            return pen.pick(
                f"PR[10,{pen.whole(1, 3)}]={self._number()}", "PR[10]=LPOS-LPOS", "PR[10]=PR[11]",
                "OFFSET CONDITION PR[10]", "OFFSET CONDITION PR[11]", f"PR[R[1]]={place}",
            )  # fmt: skip
        return pen.pick(
            "R[1]=2", "R[1]=1", "R[4]=R[4]+1", "R[3]=1", "R[4]=AR[1]", "UFRAME[2]=PR[1]",
            f"{place}={self._register()}", "R[4]=15", "UTOOL[2]=PR[11]",
            f"IF (DI[6]=ON),{one[:-1]},1]=(5)", f"IF (R[1]=2),{one}={place}",
            "IF (DI[7]=ON),R[1]=(2)",
        )  # fmt: skip

    def _structure(self, kind: int, depth: int, name: str) -> list[str]:
        pen, one, two = self.pen, self._block(depth - 1, name), self._block(depth - 1, name)
        self.labels += 1
        label = f"LBL[{self.labels}]"
        if kind <= 19:
            condition = pen.pick("DI[1]=ON", "R[1]=2", "R[4]>12")
            other = ["ELSE", *two] if pen.chance(0.5) else []
            return [f"IF ({condition}) THEN", *one, *other, "ENDIF"]
        if kind == 20:
            return ["FOR R[1]=1 TO 2", *one, "ENDFOR"]
        if kind == 21:
            label = label if pen.chance(0.9) or self.labels > 2 else "LBL[R[1]]"
            return [f"IF DI[2]=ON,JMP {label}", *one, f"LBL[{self.labels}]"]
        if kind == 22:
            return [label, *one, f"IF DI[3]=ON,JMP {label}"]
        if kind == 23:
            end = f"LBL[{self.labels + 500}]"
            cases = [f"SELECT R[1]=1,JMP {label}", f"ELSE,JMP {end}"]
            if self.subs and name == "PART":
                cases.insert(1, f"=2,CALL {self.subs[0]}")
            return [*cases, label, *one, end]
        if kind == 24:
            return ["IF (DI[4]=ON) THEN", *one, "END", "ENDIF"]
        if not self.subs or name != "PART":
            return [self._move()]
        sub = pen.pick(*self.subs)
        return [
            pen.pick(
                f"CALL {sub}", f"CALL {sub}(2)", f"CALL {sub}(R[4],1)", f"IF DI[5]=ON,CALL {sub}"
            )
        ]
