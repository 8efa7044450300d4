"""RAPID tasks of branches, loops, calls and stored points, by a seed; for ``rapid_controller``."""

from __future__ import annotations

import re

import numpy as np
from written import Pen

KINDS = ("CONST", "PERS", "VAR", "LOCAL CONST", "LOCAL PERS", "LOCAL VAR", "TASK PERS")
SETS_FRAMES = ("PDisp", "EOffs", "t1.", "t2:", "w1.", "w2:", "helper", "n:=helped")


def _leave_out(lines: list[str], barred: tuple[str, ...]) -> list[str]:
    """The lines that begin with nothing barred; where no frames may be set, none asks."""
    kept = [line for line in lines if not line.startswith(barred)]
    return [x.replace("ask()", "di9") for x in kept] if "PDisp" in barred else kept


class RapidFlowWriter:
    """Writes one job of one or two modules."""

    def __init__(self, pen: Pen) -> None:
        self.pen, self.labels = pen, 0
        self.calm = pen.chance(0.6)
        self.kinds = {f"xp{k}": pen.pick(*KINDS) for k in range(1, pen.whole(2, 5))}
        self.array = pen.pick("PERS", "VAR", "CONST")
        self.beside = [f"yp{k}" for k in range(pen.whole(0, 2))]
        self.routines = [f"sub{k}" for k in range(pen.whole(0, 2))]
        self.local: list[str] = []

    def job(self) -> dict[str, str]:
        """The modules of a job by file name."""
        pen = self.pen
        frames = [
            f"PERS tooldata t{k}:=[TRUE,{self._pose(200.0)},[2,[0,0,15],[1,0,0,0],0,0,0]];"
            for k in (1, 2)
        ] + [
            f'PERS wobjdata w{k}:=[FALSE,TRUE,"",{self._pose(900.0)},{self._pose(50.0)}];'
            for k in (1, 2)
        ]
        data = [
            "RECORD station", "robtarget at;", "num lift;", "ENDRECORD", *frames,
            *(f"{kind} robtarget {name}:={self._target()};" for name, kind in self.kinds.items()),
            f"{self.array} robtarget arr{{2}}:=[{self._target()},{self._target()}];",
            f"{pen.pick('PERS', 'VAR')} station st:=[{self._target()},25];",
            f"PERS jointtarget home:={self._axes()};",
            f"PERS pose off1:={self._pose(60.0)};", f"VAR pose off2:={self._pose(60.0)};",
            f'VAR string late:="{pen.pick(*self.routines, "nothing")}";',
            "VAR num n:=1;", "PERS num clear:=50;", "VAR num i:=1;", "VAR intnum stop1;",
        ]  # fmt: skip
        body = ["PROC main()"]
        if pen.chance(0.4):
            self.local = ["loc"]
            body += [f"VAR robtarget loc{pen.pick('', ':=' + self._target())};"]
            body += [f"loc:={self._target()};"] if body[-1].endswith("loc;") else []
        body += [*self._block(2, "", pen.whole(3, 9)), *self._handler(), "ENDPROC"]
        self.local = []
        for number, name in enumerate(self.routines):
            self.local = ["loc"] if pen.chance(0.3) else []
            begin = [f"VAR robtarget loc:={self._target()};"] if self.local else []
            barred = ("sub", "%", "CONNECT", "ISignal", *(SETS_FRAMES if not number else ()))
            lines = self._block(1, "", pen.whole(1, 3))
            body += [
                f"PROC {name}()",
                *begin,
                *_leave_out(lines, barred),
                *self._handler(),
                "ENDPROC",
            ]
        self.local = []
        if self.routines:
            body += ["TRAP halt", f"{pen.pick(self.routines[0] + ';', self._move(''))}", "ENDTRAP"]
        body += ["PROC nothing()", "ENDPROC", *self._asked()]
        more = [*self._by_reference(), *self._by_value(), *self._function(), *self._with_frames()]
        if not self.beside:
            whole = ["MODULE part", *data, *body, *more, "ENDMODULE"]
            return {"part.mod": "\n".join(whole) + "\n"}
        kept = [f"{pen.pick('CONST', 'PERS', 'VAR')} robtarget {name}:={self._target()};"
                for name in self.beside]  # fmt: skip
        if "LOCAL" in self.kinds["xp1"]:  # data of each module of one name
            kept += [f"LOCAL PERS robtarget xp1:={self._target()};"]
            more = [*more, "PROC alone()", f"MoveL xp1{self._tail()}", "ENDPROC"]
        cut = pen.whole(4, len(data)) if pen.chance(0.4) else 4
        one = ["MODULE part", *data[:4], *data[cut:], *body, "ENDMODULE"]
        kept += [line for line in data[4:cut] if not line.startswith("LOCAL")]
        one[5:5] = [line for line in data[4:cut] if line.startswith("LOCAL")]
        two = ["MODULE cell", *kept, *more]
        if pen.chance(0.5):
            seen = [n for n, k in self.kinds.items() if "LOCAL" not in k and "CONST" not in k]
            if seen:
                change = pen.pick(f"{seen[0]}:={self._target()};", f"MoveL {seen[0]}{self._tail()}")
                number = pen.pick("n:=n;", "Incr clear;", "Add clear,3;")
                two += ["PROC other()", change, number, "ENDPROC"]
                one[-2:-2] = ["other;"] if one[-2] == "ENDPROC" and pen.chance(0.7) else []
        three = ["MODULE deep", "PROC deeper()", self._frame_setting(), "ENDPROC", "ENDMODULE"]
        two += [*self._helpers(), "ENDMODULE"]
        named = (("part", one), ("cell", two), ("deep", three))
        return {f"{name}.mod": "\n".join(lines) + "\n" for name, lines in named}

    def _handler(self) -> list[str]:
        """Frames that it changes are told of, and not followed."""
        if not self.pen.chance(0.3):
            return []
        barred = ("sub", "%", "CONNECT", "ISignal", "RETURN", *SETS_FRAMES)
        lines = _leave_out(self._block(1, "", self.pen.whole(1, 3)), barred)
        return ["ERROR", *lines, self.pen.pick("RETRY;", "TRYNEXT;", "TRYNEXT;", "RETURN;")]

    def _by_reference(self) -> list[str]:
        choice = self.pen.pick(
            f"MoveL q{self._tail()}", f"q.trans.z:=q.trans.z+7;\nMoveL q{self._tail()}",
            f"q:={self._target()};", f"q:={self._target()};\nMoveL q{self._tail()}",
            f"MoveL {self._target()}{self._tail()}", "q.trans.x:=64.25;",
        )  # fmt: skip
        return ["PROC byref(INOUT robtarget q)", *choice.split("\n"), "ENDPROC"]

    def _asked(self) -> list[str]:
        """A function that may do more than answer."""
        frame = "" if self.calm else self._setting(11, "")
        side = self.pen.pick("", "n:=3-n;", frame, self._move(""))
        return ["FUNC num ask()", side, "IF di9=1 THEN", "RETURN 1;", "ENDIF", "RETURN 2;",
                "ENDFUNC"]  # fmt: skip

    def _helpers(self) -> list[str]:
        """Routines of another module that may change frames, or call back."""
        pen, back = self.pen, [f"{name};" for name in self.routines]
        some = [pen.pick("", *back, "PDispOff;", self._frame_setting(), "deeper;", *back)
                for _ in range(pen.whole(1, 2))]  # fmt: skip
        return ["PROC helper()", *some, "ENDPROC", "FUNC num helped()", pen.pick("", "helper;"),
                "RETURN 1;", "ENDFUNC"]  # fmt: skip

    def _by_value(self) -> list[str]:
        choice = self.pen.pick(
            f"MoveL q{self._tail()}", f"q.trans.z:=q.trans.z+20;\nMoveL q{self._tail()}",
            f"MoveL Offs(q,0,0,5){self._tail()}",
        )  # fmt: skip
        name = self.pen.pick("q", "q", "xp1")  # a parameter may hide data
        lines = re.sub(r"\bq\b", name, choice).split("\n")
        return [f"PROC byval(robtarget {name})", *lines, "ENDPROC"]

    def _function(self) -> list[str]:
        choice = self.pen.pick("RETURN Offs(q,0,h,0);", "q.trans.z:=q.trans.z+h;\nRETURN q;")
        side = self.pen.pick("n:=3-n;", "clear:=clear+1;", "n:=n;")
        return ["FUNC robtarget above(robtarget q,num h)", *choice.split("\n"), "ENDFUNC",
                "FUNC robtarget nxt()", side, "RETURN arr{n};", "ENDFUNC"]  # fmt: skip

    def _with_frames(self) -> list[str]:
        move = "MoveL q,v1,z1,t\\WObj:=w;"
        return ["PROC within(robtarget q,PERS tooldata t,PERS wobjdata w)", move, "ENDPROC"]

    def _numbers(self, values: np.ndarray, decimals: int) -> str:
        return "[" + ",".join(f"{value:.{decimals}f}" for value in values) + "]"

    def _pose(self, size: float) -> str:
        q = self.pen.rng.normal(size=4)
        place = self._numbers(self.pen.rng.uniform(-size, size, 3), 3)
        return f"[{place},{self._numbers(q / np.linalg.norm(q), 8)}]"

    def _target(self) -> str:
        return f"{self._pose(1200.0)[:-1]},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"

    def _axes(self) -> str:
        axes = self._numbers(self.pen.rng.uniform(-90.0, 90.0, 6), 4)
        return f"[{axes},[9E9,9E9,9E9,9E9,9E9,9E9]]"

    def _tail(self) -> str:
        pen = self.pen
        work = pen.pick("\\WObj:=w1", "\\WObj:=w1", "\\WObj:=w1", "\\WObj:=w2", "")
        return f",v100,{pen.pick('z10', 'fine')},{pen.pick('t1', 't1', 't1', 't2')}{work};"

    def _free(self) -> list[str]:
        """What may be given another value: names, the array's elements, the record's target."""
        names = [name for name, kind in self.kinds.items() if "CONST" not in kind]
        array = [] if self.array == "CONST" else ["arr{2}", "arr{1}"]
        return [*names, *names, *self.local, *array, "st.at"]

    def _point(self) -> str:
        pen = self.pen
        return pen.pick(*self.kinds, *self.kinds, *self.beside, *self.local, "st.at")

    def _number(self, counter: str) -> str:
        if self.pen.chance(0.12):
            return "ai1"
        fixed = f"{self.pen.rng.uniform(-90.0, 90.0):.2f}"
        counted = (f"{counter}*{self.pen.whole(5, 40)}.5",) if counter else ()
        other = f"{self._point()}.trans.x+{self.pen.whole(1, 60)}"
        return self.pen.pick(fixed, fixed, "clear", "2*clear", "st.lift", other, *counted)

    def _goal(self, counter: str) -> str:
        kind = self.pen.whole(0, 13)
        if kind <= 3:
            return self._target()
        if kind <= 7:
            return self._point()
        if kind == 8:
            return f"arr{{{self.pen.pick('1', '2', 'n', *([counter] if counter else []))}}}"
        if kind == 9:
            return f"Offs({self._point()},0,0,{self._number(counter)})"
        if kind == 10:
            return f"RelTool({self._point()},0,{self._number(counter)},5\\Rz:=30)"
        if kind == 11:
            return f"above({self._point()},{self._number(counter)})"
        one, two = self._point(), self._point()
        mixed = f"[{one}.trans,{two}.rot,[0,0,0,0],{one}.extax]"
        nested = f"Offs(RelTool({one},0,0,{self._number(counter)}),0,9,0)"
        return self.pen.pick(
            "Offs(arr{n},5,0,0)",
            mixed,
            nested,
            "nxt()",
            f"Offs({self._target()},0,4,0)",
            *self.kinds,
        )

    def _move(self, counter: str) -> str:
        return f"{self.pen.pick('MoveL', 'MoveL', 'MoveJ')} {self._goal(counter)}{self._tail()}"

    def _block(self, depth: int, counter: str, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 5)
        return [line for _ in range(count) for line in self._statement(depth, counter)]

    def _statement(self, depth: int, counter: str) -> list[str]:
        kind, pen = self.pen.whole(0, 30), self.pen
        if self.calm and 11 <= kind <= 16 and pen.chance(0.75):
            kind = 0
        if kind <= 8:
            return [self._move(counter)]
        if kind == 9:
            return [f"MoveC {self._goal(counter)},{self._goal(counter)}{self._tail()}"]
        if kind == 10:
            return [f"MoveAbsJ {pen.pick('home', self._axes())}{self._tail()}"]
        if kind <= 16:
            return [self._setting(kind, counter)]
        if not depth:
            return [f"MoveL {self._point()}{self._tail()}"]
        return self._structure(kind, depth, counter)

    def _frame_setting(self) -> str:
        """A change of a frame that any module can make."""
        return self.pen.pick(
            f"PDispSet {self._pose(40.0)};", "PDispOff;", "PDispOff;", "t1.tframe.trans.z:=99;",
            "EOffsSet [10,0,0,0,0,0];", "EOffsOff;", f"w1.uframe:={self._pose(300.0)};",
            "w2:=w1;", "t2:=t1;", f"t1.tframe:={self._pose(90.0)};",
        )  # fmt: skip

    def _setting(self, kind: int, counter: str) -> str:
        pen, free = self.pen, self.pen.pick(*self._free())
        if kind == 11:
            turned = pen.pick("", "\\Rot")
            return pen.pick(
                self._frame_setting(), self._frame_setting(), self._frame_setting(),
                f"PDispOn {turned}\\ExeP:={pen.pick(*self.kinds)},{pen.pick(*self.kinds)},t1;",
                f"PDispSet {pen.pick('off1', 'off2')};", "w1.oframe:=off1;",
                "w1.oframe.trans.x:=clear;",
            )  # fmt: skip
        if kind <= 13:
            return f"{free}.{pen.pick('trans.x', 'trans.y', 'trans.z')}:={self._number(counter)};"
        if kind == 14:
            moved = f"Offs({self._point()},0,0,{self._number(counter)})"
            other = pen.pick("CRobT(\\Tool:=t1\\WObj:=w1)", f"above({self._point()},8)")
            return f"{free}:={pen.pick(self._point(), self._target(), moved, other)};"
        if kind == 15:
            return pen.pick(
                f"{pen.pick('off1', 'off2')}.trans.{pen.pick(*'xyz')}:={self._number(counter)};",
                f"{free}.trans:={self._point()}.trans;", f"{free}.rot:={self._point()}.rot;",
                f"{free}.trans:={self._point()}.trans+[0,0,10];", "off1:=off2;",
            )  # fmt: skip
        return pen.pick(
            "n:=2;", "n:=1;", "clear:=40;", "Incr clear;", "Add clear,-2;", "Add st.lift,3;",
            "clear:=clear+1;", "st.lift:=clear;", "i:=2;",
            f"{free}:=arr{{n}};", f"st:=[{self._target()},9];",
        )  # fmt: skip

    def _structure(self, kind: int, depth: int, counter: str) -> list[str]:
        pen, one = self.pen, self._block(depth - 1, counter)
        two = self._block(depth - 1, counter)
        if kind <= 18:
            condition = pen.pick("di1=1", "n=2", "di2=1", "clear>45", "ask()=1", "n=1 OR ask()=1")
            other = ["ELSE", *two] if pen.chance(0.5) else []
            if pen.chance(0.3):
                other = [f"ELSEIF {pen.pick('di7=1', 'ask()=1')} THEN", *two, *other]
            return [f"IF {condition} THEN", *one, *other, "ENDIF"]
        if kind == 19 and not counter:
            count = pen.pick("1 TO 2", "1 TO 2", "2 TO 1 STEP -1", "1 TO n")
            return [f"FOR i FROM {count} DO", *self._block(depth - 1, "i"), "ENDFOR"]
        if kind == 20:
            return [f"WHILE {pen.pick('di3=1', 'ask()=1')} DO", *one, "ENDWHILE"]
        if kind == 21:
            return [f"IF di4=1 {pen.pick(self._move(counter), self._setting(14, counter))}"]
        if kind == 22:
            return ["IF di5=1 THEN", *one, "RETURN;", "ENDIF"]
        if kind == 23:
            self.labels += 1
            name = f"lab{self.labels}"
            return [f"IF di6=1 GOTO {name};", *self._block(0, counter), f"{name}:"]
        if kind == 24:
            other = ["DEFAULT:", self._move(counter)] if pen.chance(0.5) else []
            return ["TEST n", "CASE 1:", *one, "CASE 2,3:", *two, *other, "ENDTEST"]
        if kind == 25:
            free = pen.pick(*self._free())
            within = f"within {self._point()},t{pen.whole(1, 2)},w{pen.whole(1, 2)};"
            return [
                pen.pick(f"byref {free};", f"byref {free};", f"byval {self._target()};", within)
            ]
        if kind == 28 and self.beside and not (self.calm and pen.chance(0.75)):
            return [pen.pick("helper;", "helper;", "n:=helped();")]
        if kind == 29 and not self.calm:
            return [f"IF di8=1 {pen.pick('ExitCycle;', 'EXIT;')}"]
        if not self.routines:
            alone = self.beside and "LOCAL" in self.kinds["xp1"]
            return ["alone;" if alone and pen.chance(0.5) else f"byval {self._point()};"]
        name = pen.pick(*self.routines)
        if kind == 26:
            return [pen.pick(f"{name};", f"{name};", f'%"{self.routines[0]}"%;', "%late%;")]
        return pen.pick("CONNECT stop1 WITH halt;\nISignalDI di9,1,stop1;", "IDelete stop1;").split(
            "\n"
        )
