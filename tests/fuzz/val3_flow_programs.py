"""VAL3 applications of branches, loops, calls, tasks and changed data, by a seed.

For ``val3_controller``. Not written, because their meaning is not sure: names of another case,
a reference to an element that is then indexed, and a frame that a library holds as a parent.
"""

from __future__ import annotations

from written import Pen

FRAMES, TOOLS = ("f1", "f2", "fa[0]", "fa[1]"), ("t1", "t2", "ta[1]")
CHANGES_FRAMES = ("f1", "f2", "fa", "t1", "t2", "link(f", "n=setFrame")
_HEAD = '<?xml version="1.0" encoding="utf-8"?>'
_XSI = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"'
_SCHEMA = 'xmlns="http://www.staubli.com/robotics/VAL3'


class Val3FlowWriter:
    """Writes one application: a project, its data, programs, and now and then a library."""

    def __init__(self, pen: Pen) -> None:
        self.pen = pen
        self.calm = pen.chance(0.7)
        self.rare = pen.chance(0.08)
        self.points = [f"xp{k}" for k in range(1, pen.whole(2, 6))]
        self.size = pen.whole(2, 4)
        self.stored = ["pA", "pB"]
        self.subs = [f"sub{k}" for k in range(pen.whole(0, 2))]
        self.library = pen.chance(0.3)
        self.by_reference = pen.chance(0.5)

    def job(self) -> dict[str, str]:
        """The files of an application by name."""
        pen = self.pen
        programs = {"start": self._program(self._block(2, pen.whole(4, 12)), hides=0.1)}
        for number, name in enumerate(self.subs):
            lines = self._block(1, pen.whole(1, 4))
            barred = ("call sub", "taskCreate", *(CHANGES_FRAMES if number else ()))
            programs[name] = self._program([x for x in lines if not x.startswith(barred)], 0.2)
        beside = [x for x in self._block(1, pen.whole(1, 3)) if not x.startswith(("call", "task"))]
        programs |= {"beside": self._program(beside), "stop": self._program(["waitEndMove()"])}
        programs |= self._routines()
        data = [*self._frames(), *self._points()]
        files = {"cell.dtx": self._database(data)}
        if self.library:
            values = [self._value(0, self._pose(), f"fL[{k}]") for k in (0,)]
            frame = [self._value(0, self._pose(400.0), "world[0]")]
            tool = [self._value(0, self._pose(150.0), "flange[0]")]
            held = [*_data("frame", "fL", frame), *_data("tool", "tL", tool)]
            files["lib.dtx"] = self._database([*held, *_data("pointRx", "lp", values)])
            programs["libgo"] = self._program(
                pen.pick("movel(lp,tL,mNom)", "movej(lp,tL,mNom)\nmovel(lp,tL,mNom)").split("\n")
            )
            programs["start"] = programs["start"].replace("begin\n", "begin\ncall libgo()\n", 1)
        files |= {f"{name}.pgx": _spell_program(name, text) for name, text in programs.items()}
        listed = [f'<Program file="{name}.pgx" />' for name in programs]
        lines = [_HEAD, f'<Project {_SCHEMA}/Project/3">']
        lines += ['<Parameters version="s7.3.1" stackSize="5000" millimeterUnit="true" />']
        lines += ["<Programs>", *listed, "</Programs>", "<Database>"]
        lines += ['<Data file="cell.dtx" />', "</Database>", "<Libraries>"]
        lines += ['<Library alias="lib" path="./lib/lib.pjx" />'] * self.library
        return {"cell.pjx": "\n".join([*lines, "</Libraries>", "</Project>", ""]), **files}

    # Data

    def _database(self, data: list[str]) -> str:
        head = [_HEAD, f'<Database {_XSI} {_SCHEMA}/Data/2">', "<Datas>"]
        return "\n".join([*head, *data, "</Datas>", "</Database>", ""])

    def _frames(self) -> list[str]:
        pen, pose = self.pen, self._pose
        second = pen.pick("f1[0]", "f1[0]", "world[0]")
        both = [self._value(0, pose(90.0), "f2[0]"), self._value(1, pose(500.0), "world[0]")]
        father = pen.pick("t1[0]", "flange[0]")
        return [
            *_data("frame", "f1", [self._value(0, pose(800.0), "world[0]")]),
            *_data("frame", "f2", [self._value(0, pose(300.0), second)]),
            *_data("frame", "fa", both),
            *_data("tool", "t1", [self._value(0, pose(150.0), "flange[0]")]),
            *_data("tool", "t2", [self._value(0, pose(60.0), father)]),
            *_data("tool", "ta", [self._value(k, pose(120.0), "flange[0]") for k in (0, 1)]),
            *_data("trsf", "tr1", [f'<Value key="0" x="{pen.whole(-40, 40)}" z="-50" />']),
            *_data("trsf", "tr2", [f'<Value key="0" {pose(50.0)} />']),
            *_data("num", "n", ['<Value key="0" value="1" />']),
            *_data("num", "i", ['<Value key="0" value="0" />']),
            *_data("num", "clear", ['<Value key="0" value="50" />']),
        ]

    def _points(self) -> list[str]:
        father, pen = self.pen.pick(*FRAMES), self.pen
        joints = [f'<Value key="{k}" {self._axes()} />' for k in range(2)]
        return [
            *(line for name in [*self.points, *self.stored]
              for line in _data("pointRx", name, [self._target(0, pen.pick(*FRAMES))])),
            *_data("pointRx", "arr", [self._target(k, father) for k in range(self.size)]),
            *_data("jointRx", "jHome", [f'<Value key="0" {self._axes()} />']),
            *_data("jointRx", "jArr", joints),
        ]  # fmt: skip

    def _target(self, key: int, father: str) -> str:
        return self._value(key, self._pose(), father if "[" in father else f"{father}[0]")

    def _value(self, key: int, pose: str, father: str) -> str:
        return f'<Value key="{key}" {pose} fatherId="{father}" />'

    def _six(self, size: float) -> list[str]:
        values = [*self.pen.rng.uniform(-size, size, 3), *self.pen.rng.uniform(-75.0, 75.0, 3)]
        return [f"{value:.3f}" for value in values]

    def _pose(self, size: float = 1000.0) -> str:
        names = ("x", "y", "z", "rx", "ry", "rz")
        return " ".join(f'{n}="{v}"' for n, v in zip(names, self._six(size), strict=True))

    def _axes(self) -> str:
        axes = self.pen.rng.uniform(-90.0, 90.0, 6)
        return " ".join(f'j{k}="{value:.4f}"' for k, value in enumerate(axes, 1))

    # Programs

    def _program(self, lines: list[str], hides: float = 0.0) -> str:
        """Locals, and the code; a local may hide data."""
        if not any("l_p" in line for line in lines) and self.pen.chance(hides):
            name, value = self.pen.pick(*self.points), ",".join(self._six(900.0))
            return "\n".join([f"<l>{name}", "begin", f"{name}.trsf={{{value}}}", *lines, "end"])
        first = f"l_p={self.pen.pick(*self.points, 'here(t1,f1)')}"
        begin = [first] * any("l_p" in line for line in lines)
        return "<l>l_p\n" * bool(begin) + "\n".join(["begin", *begin, *lines, "end"])

    def _routines(self) -> dict[str, str]:
        """Programs with parameters: by value, by reference, and with a tool and a frame."""
        pen, name = self.pen, self.pen.pick("x_p", "x_p", self.points[0])
        by_value = pen.pick(
            f"movel({name},t1,mNom)", f"{name}.trsf.z={name}.trsf.z+20\nmovel({name},t1,mNom)",
            f"movel(appro({name},tr1),t1,mNom)", f"link({name},f1)\nmovel({name},t1,mNom)",
        )  # fmt: skip
        by_reference = pen.pick(
            "movel(x_p,t1,mNom)", "x_p.trsf.z=x_p.trsf.z+7\nmovel(x_p,t1,mNom)",
            f"x_p={pen.pick(*self.points)}", f"x_p.trsf={self._literal(900.0)}",
            "x_p.trsf.x=64.25", "link(x_p,f2)\nmovel(x_p,t1,mNom)",
        )  # fmt: skip
        within = pen.pick(
            "movel(x_p,x_t,mNom)", "x_p=here(x_t,x_f)\nmovel(x_p,x_t,mNom)",
            "movel(compose(x_p,x_f,tr1),x_t,mNom)", "x_f.trsf.z=35\nmovel(x_p,x_t,mNom)",
        )  # fmt: skip
        point, use = self.points[0], "<r>" if self.by_reference else "<v>"
        approached = pen.pick(
            "movel(appro(x_p,tr1),x_t,mNom)\nmovel(x_p,x_t,mNom)", "movel(x_p,x_t,mNom)",
            "movel(x_p[0],x_t[0],mNom)", f"movec(x_p,{pen.pick(*self.points)},x_t,mNom)",
            f"l_p=x_p\nmovel(l_p,x_t,mNom)\nmovel({pen.pick(*self.points)},x_t,mNom)",
        )  # fmt: skip
        deeper = pen.pick(
            "call reach(x_b,t1)\nmovel(x_a,t1,mNom)", "call reach(x_a,t1)\ncall reach(x_b,t1)",
            "movec(x_a,x_b,t1,mNom)", "call goref(x_a)\nmovel(x_b,t1,mNom)",
            "call go(appro(x_a,tr1))\ncall reach(x_b,t1)", "pA.trsf=x_b.trsf\nmovel(x_a,t1,mNom)",
            f"movel(x_a,t1,mNom)\nif dIn[8]\ncall twice(x_b,{pen.pick('x_a', point)})\nendIf",
        )  # fmt: skip
        hidden = "<l>l_p\n" * ("l_p" in approached)
        return {
            "reach": f"{use}x_p pointRx\n<v>x_t tool\n{hidden}begin\n{approached}\nend",
            "twice": f"{use}x_a pointRx\n{use}x_b pointRx\nbegin\n{deeper}\nend",
            "go": f"<v>{name} pointRx\nbegin\n{by_value}\nend",
            "goref": f"<r>x_p pointRx\nbegin\n{by_reference}\nend",
            "within": f"<v>x_p pointRx\n<v>x_t tool\n<r>x_f frame\nbegin\n{within}\nend",
        }

    def _literal(self, size: float) -> str:
        return "{" + ",".join(self._six(size)) + "}"

    def _shift(self) -> str:
        """A transformation for ``appro`` and ``compose``."""
        pen = self.pen
        away = f"{{0,0,{pen.pick('-50', '-clear', '20*n')},0,0,0}}"
        return pen.pick(away, away, away, "tr1", "tr2", f"{{{pen.whole(1, 9)},0,-5,0,0,30}}")

    def _point(self) -> str:
        pen = self.pen
        more = [f"lib:{x}" for x in ("lp",) if self.library and pen.chance(0.3)]
        return pen.pick(*self.points, *self.points, *self.points, f"arr[{self._index()}]",
                        pen.pick(*self.stored), *more)  # fmt: skip

    def _index(self) -> str:
        return self.pen.pick("0", "1", "1", "n", "i")

    def _number(self) -> str:
        if self.pen.chance(0.12):
            return "aioGet(aIn)"
        fixed = f"{self.pen.rng.uniform(-90.0, 90.0):.2f}"
        return self.pen.pick(
            fixed, fixed, "clear", "2*clear", f"{self._point()}.trsf.x+{self.pen.whole(1, 60)}",
            f"jHome.j{self.pen.whole(1, 6)}", "i*12.5",
        )  # fmt: skip

    def _goal(self) -> str:
        kind, pen = self.pen.whole(0, 19), self.pen
        if kind <= 11:
            return pen.pick(*self.points, *self.points, f"arr[{self._index()}]", *self.stored)
        if kind <= 14:
            return f"appro({self._point()},{self._shift()})"
        if kind == 15:
            return f"compose({self._point()},{pen.pick(*FRAMES)},{self._shift()})"
        if kind == 16:
            inner = f"compose({self._point()},{pen.pick(*FRAMES)},{self._shift()})"
            return f"appro({pen.pick(inner, 'here(t1,f1)')},{self._shift()})"
        return self._point()

    def _tool(self) -> str:
        odd = ("flange", "ta[n]") if self.rare else TOOLS
        return self.pen.pick(*["t1"] * 12, *odd)

    def _move(self) -> str:
        pen, tool = self.pen, self._tool()
        if pen.chance(0.08):
            axes = f"jHome+{{0,0,{pen.whole(1, 9)},0,0,0}}"
            goal = pen.pick("jHome", "jHome", "jArr[1]", "jArr[n]", *([] if self.calm else [axes]))
            return f"movej({goal},{tool},mNom)"
        if pen.chance(0.08):
            return f"movec({self._goal()},{self._goal()},{tool},mNom)"
        word = pen.pick(*["movel", "movel", "movej"] * 6, "nId=movel")
        return f"{word}({self._goal()},{tool},mNom)"

    def _block(self, depth: int, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 4)
        return [line for _ in range(count) for line in self._statement(depth)]

    def _statement(self, depth: int) -> list[str]:
        kind, pen = self.pen.whole(0, 27), self.pen
        if self.calm and 11 <= kind <= 17 and pen.chance(0.8):
            kind = 0
        if kind <= 10:
            return [self._move()]
        if kind <= 17:
            return [self._setting(kind)]
        if not depth:
            return [f"movel({self._point()},t1,mNom)"]
        return self._structure(kind, depth)

    def _setting(self, kind: int) -> str:
        pen, point, stored = self.pen, self._point(), self.pen.pick(*self.stored, "l_p")
        if kind <= 12:
            derived = pen.pick(f"appro({self._point()},{self._shift()})", self._goal())
            return f"{stored}={derived}"
        if kind == 13:
            return f"{point}.trsf.{pen.pick('x', 'y', 'z', 'rz')}={self._number()}"
        if kind == 14:
            other = pen.pick(self._point(), "here(t1,f1)", "jointToPoint(t1,f2,jHome)")
            return f"{pen.pick(point, stored, stored)}={other}"
        if kind == 15:
            trsf = pen.pick(
                self._literal(900.0), "tr2", f"{self._point()}.trsf*tr1",
                f"position({self._point()},{pen.pick(*FRAMES, 'world')})",
                f"position({pen.pick(*FRAMES)},world)",
            )  # fmt: skip
            return pen.pick(f"{pen.pick(point, stored)}.trsf={trsf}", f"tr2={trsf}")
        if kind == 16:
            return self._change_frame(point)
        return pen.pick(
            "n=0", "n=1", "clear=40", "clear=clear+1", "tr1.x=25", "tr1.z=-clear",
            f"arr[{self._index()}]={point}", f"tr2.rz={self._number()}", "jHome=jArr[0]",
            f"jHome.j{pen.whole(1, 6)}={self._number()}", "jHome=herej()", "open(t1)",
            f"movel({stored},t1,mNom)", "waitEndMove()", "clear=size(arr)*15",
            f"link({point},{pen.pick(*FRAMES, 'world')})",
        )  # fmt: skip

    def _change_frame(self, point: str) -> str:
        pen, one, two = self.pen, self._point(), f"appro({self._point()},{self._shift()})"
        lib = ["lib:fL.trsf.x=77", "lib:tL.trsf.z=5"] if self.library else []
        return pen.pick(
            "f1.trsf.z=clear", "f2.trsf.x=33", "fa[0].trsf.rz=12", "f2=fa[1]", "f2.trsf=tr1",
            "t1.trsf.z=140", "t2.trsf=tr1", "t2=ta[0]", "link(f2,world)", "link(fa[1],f1)",
            f"n=setFrame({point},{one},{self._point()},f2)",
            f"n=setFrame({pen.pick(one, two)},{point},{two},f2)",
            f"n=setFrame(pA,{point},{one},fa[1])", "tr2=position(f1,world)", "f2.trsf=f1.trsf*tr1",
            *lib,
        )  # fmt: skip

    def _structure(self, kind: int, depth: int) -> list[str]:
        pen, one, two = self.pen, self._block(depth - 1), self._block(depth - 1)
        if kind <= 19:
            condition = pen.pick("dIn[1]==true", "n==1", "clear>45", "dIn[2] and not dIn[3]")
            other = ["else", *two] if pen.chance(0.5) else []
            if pen.chance(0.3):
                other = ["elseIf dIn[7]", *two]
            return [f"if {condition}", *one, *other, "endIf"]
        if kind == 20:
            last = pen.pick("1", "1", "size(arr)-1", "n")
            step = pen.pick("", "", " step 1")
            moved = pen.pick("movel(arr[i],t1,mNom)", "movej(arr[i],t1,mNom)", self._move())
            return [f"for i=0 to {last}{step}", moved, *self._block(depth - 1, 1), "endFor", "i=0"]
        if kind == 21:
            return ["while dIn[4]", *one, "endWhile"]
        if kind == 22:
            return ["do", *one, f"until {pen.pick('dIn[5]', 'true')}"]
        if kind == 23:
            other = ["default", *two, "break"] if pen.chance(0.5) else []
            return ["switch n", "case 1", *one, "break", "case 0,2", self._move(), "break",
                    *other, "endSwitch"]  # fmt: skip
        if kind == 24:
            return ["if dIn[6]", *one, "return", "endIf"]
        if kind == 25:
            word = pen.pick('taskCreate "t1",10,', 'taskCreateSync "t2",0.004,bOver,')
            return [word + pen.pick("beside()", *(["far:lost()"] * self.rare), "beside()")]
        if kind == 26 and (self.calm or pen.chance(0.6)):
            goal = pen.pick(
                *[self._point()] * 3, "l_p", *([] if self.by_reference else [self._goal()])
            )
            return [pen.pick(
                f"call reach({goal},{pen.pick(*['t1'] * 5, 't2')})",
                f"call twice({self._point()},{goal})",
            )]  # fmt: skip
        if kind == 26:
            frame, tool = pen.pick("f2", "f2", "fa[1]"), pen.pick("t1", "t2")
            return [pen.pick(
                f"call goref({self._point()})", f"call go({self._point()})",
                f"call go(appro({self._point()},{self._shift()}))", "call far:lost()",
                f"call within({self._point()},{tool},{frame})",
            )]  # fmt: skip
        if not self.subs:
            return [f"movel({pen.pick(*self.points)},t1,mNom)"]
        return [f"call {pen.pick(*self.subs)}()"]


def _data(kind: str, name: str, values: list[str]) -> list[str]:
    head = f'<Data name="{name}" access="private" xsi:type="array" type="{kind}"'
    return [f'{head} size="{len(values)}">', *values, "</Data>"]


def _spell_program(name: str, text: str) -> str:
    """The file of a program whose parameters and locals stand in lines before its code."""
    head, _, code = text.partition("begin\n")
    given = [line[3:].split() for line in head.splitlines() if not line.startswith("<l>")]
    uses = ['use="reference" ' * (line[1] == "r") for line in head.splitlines() if line[1] != "l"]
    own = [f'<Local name="{line[3:]}" type="pointRx" xsi:type="array" size="1" />'
           for line in head.splitlines() if line.startswith("<l>")]  # fmt: skip
    parameters = [
        f'<Parameter name="{each[0]}" type="{each[1]}" {use}xsi:type="element" dimensions="1" />'
        for each, use in zip(given, uses, strict=True)
    ]
    lines = [_HEAD, f'<Programs {_XSI} {_SCHEMA}/Program/2">', f'<Program name="{name}">']
    lines += [f'<Parameters {_SCHEMA}/Param/1">', *parameters, "</Parameters>"]
    lines += ["<Locals>", *own, "</Locals>", f"<Code><![CDATA[begin\n{code}]]></Code>"]
    return "\n".join([*lines, "</Program>", "</Programs>", ""])
