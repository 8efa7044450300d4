"""UR scripts of branches, loops, calls and stored poses, by a seed; for ``urscript_controller``."""

from __future__ import annotations

from written import Pen

FRAMES = ("f1", "f2")


class UrFlowWriter:
    """Writes one script."""

    def __init__(self, pen: Pen) -> None:
        self.pen = pen
        self.calm = pen.chance(0.6)
        self.points = [f"xp{k}" for k in range(1, pen.whole(2, 5))]
        self.local: list[str] = []
        self.threads: list[str] = []

    def job(self) -> dict[str, str]:
        """The file of a job by name."""
        pen = self.pen
        lines = ["def part():"]
        lines += [
            f"{pen.pick('', '', 'global ', 'local ')}{p} = {self._pose()}" for p in self.points
        ]
        lines += [f"{f} = {self._pose(0.3)}" for f in FRAMES]
        lines += [f"arr = [{self._pose()}, {self._pose()}]", f"home = {self._axes()}"]
        lines += ["n = 1", "clear = 0.05", "i = 0", f"t1 = {self._pose(0.2)}"]
        if pen.chance(0.8):
            lines += [pen.pick("set_tcp(t1)", f"set_tcp({self._pose(0.2)})")]
        self.subs = [f"sub{k}" for k in range(pen.whole(0, 2))]
        for number, name in enumerate(self.subs):
            self.local = ["loc"] if pen.chance(0.4) else []
            begin = [f"{pen.pick('local ', '')}loc = {self._pose()}"] if self.local else []
            if pen.chance(0.2):
                begin += [f"local {pen.pick(*self.points)} = {self._pose()}"]
            body = [x for x in self._block(1, pen.whole(1, 4)) if not x.startswith("sub")]
            body = [x for x in body if number or not x.startswith("set_tcp")]
            lines += [f"def {name}():", *begin, *body, "end"]
        self.local = []
        if pen.chance(0.3):  # a tool set there is told of, and not followed
            body = [x for x in self._block(1, pen.whole(1, 3)) if not x.startswith("set_tcp")]
            lines += ["thread beside():", *body, "end"]
            self.threads = ["beside"]
        lines += [*self._routines(), *self._block(2, pen.whole(3, 10)), "end"]
        if pen.chance(0.3):
            lines += ["part()"]
        return {"part.script": "\n".join(lines) + "\n"}

    def _routines(self) -> list[str]:
        pen = self.pen
        name = pen.pick("q", "q", self.points[0])  # a parameter may hide a variable
        go = pen.pick(
            f"movel({name})", f"{name}[2] = {name}[2]+0.02\nmovel({name})",
            f"movel(pose_trans({name}, {self._pose(0.05)}))", f"{name} = {self._pose()}",
            f"{name} = {self._pose()}\nmovel({name}, a=1.2)",
        )  # fmt: skip
        above = pen.pick("q[2] = q[2]+h\nreturn q", "return pose_add(q, p[0,0,h,0,0,0])")
        return [f"def go({name}):", *go.split("\n"), "end",
                "def above(q, h):", *above.split("\n"), "end"]  # fmt: skip

    def _pose(self, size: float = 1.2) -> str:
        place, turn = self.pen.rng.uniform(-size, size, 3), self.pen.rng.normal(size=3)
        return "p[" + ",".join(f"{v:.6f}" for v in (*place, *turn)) + "]"

    def _axes(self) -> str:
        return "[" + ",".join(f"{v:.6f}" for v in self.pen.rng.uniform(-2.0, 2.0, 6)) + "]"

    def _point(self) -> str:
        return self.pen.pick(*self.points, *self.points, *self.local)

    def _number(self) -> str:
        return self.pen.pick(
            f"{self.pen.rng.uniform(-0.2, 0.2):.4f}", "clear", "2*clear", "i*0.01",
            "get_standard_analog_in(0)", f"{self._point()}[0]+0.05",
        )  # fmt: skip

    def _target(self) -> str:
        pen, kind = self.pen, self.pen.whole(0, 15)
        if kind <= 3:
            return self._pose()
        if kind <= 7:
            return self._point()
        if kind == 8:
            return f"arr[{pen.pick('0', '1', 'n')}]"
        if kind <= 10:
            frame, inner = pen.pick(*FRAMES, self._pose(0.3)), pen.pick(self._pose(), self._point())
            return f"pose_trans({frame}, {inner})"
        if kind == 11:
            return f"pose_trans({self._point()}, p[0,0,{pen.pick('-0.05', 'clear')},0,0,0])"
        if kind == 12:
            return f"pose_add({self._point()}, {pen.pick(self._pose(0.1), FRAMES[0])})"
        if kind == 13:
            return f"get_inverse_kin({pen.pick(self._pose(), self._point())})"
        return pen.pick(f"above({self._point()}, {self._number()})", self._point(), self._axes())

    def _move(self) -> str:
        word = self.pen.pick("movel", "movel", "movej", "movep")
        named = self.pen.pick("", "", "", "", "", "pose=")
        tail = self.pen.pick("", ", a=1.2, v=0.25", *([] if named else [",1.2,0.25,0,0.001"]))
        if self.pen.chance(0.08) and not named:
            return f"movec({self._target()}, {self._target()}{tail})"
        target = self.pen.pick("home", self._axes()) if self.pen.chance(0.08) else self._target()
        return f"{word}({named}{target}{tail})"

    def _block(self, depth: int, size: int = 0) -> list[str]:
        count = size or self.pen.whole(1, 4)
        return [line for _ in range(count) for line in self._statement(depth)]

    def _statement(self, depth: int) -> list[str]:
        kind, pen = self.pen.whole(0, 24), self.pen
        if self.calm and 10 <= kind <= 16 and pen.chance(0.75):
            kind = 0
        if kind <= 9:
            return [self._move()]
        if kind <= 16:
            return [self._setting(kind)]
        if not depth:
            return [f"movel({self._point()})"]
        one, two = self._block(depth - 1), self._block(depth - 1)
        if kind <= 18:
            condition = pen.pick("get_standard_digital_in(1)", "n == 1", "clear > 0.055")
            other = ["else:", *two] if pen.chance(0.5) else []
            if pen.chance(0.3):
                other = ["elif get_standard_digital_in(2):", *two]
            return [f"if {condition}:", *one, *other, "end"]
        if kind == 19:
            return ["i = 0", "while i < 2:", *one, "i = i+1", "end"]
        if kind == 20:
            return ["while get_standard_digital_in(3):", *one, "end"]
        if kind == 21:
            stop = ["if get_standard_digital_in(4):", "break", "end"]
            return ["while True:", *one, *stop, *self._block(0), "end"]
        if kind == 22:
            return ["if get_standard_digital_in(5):", *one, "return", "end"]
        if self.threads and pen.chance(0.5):
            return [pen.pick("th = run beside()", "run beside()", "join th", "kill th")]
        if kind == 23 or not self.subs:
            return [f"go({pen.pick(self._point(), self._pose())})"]
        return [f"{pen.pick(*self.subs)}()"]

    def _setting(self, kind: int) -> str:
        pen, point = self.pen, self._point()
        if kind <= 11:
            return f"{point}[{pen.whole(0, 3)}] = {self._number()}"
        if kind <= 13:
            other = pen.pick(
                f"pose_add({self._point()}, {self._pose(0.1)})", "get_actual_tcp_pose()"
            )
            return f"{point} = {pen.pick(self._point(), self._pose(), self._pose(), other)}"
        if kind == 14:
            return f"{pen.pick(*FRAMES)} = {pen.pick(self._pose(0.3), point, 'pose_inv(f2)')}"
        if kind == 15:
            return f"set_tcp({pen.pick('t1', self._pose(0.2), self._pose(0.2))})"
        return pen.pick(
            "n = 0", "n = 1", "clear = 0.06", "clear = clear+0.01",
            f"arr[{pen.whole(0, 1)}] = {point}", f"{point} = above({self._point()}, 0.03)",
            f"t1 = {self._pose(0.2)}",
            f"{point} = arr[{pen.pick('0', 'n')}]",
            f"{point} = pose_sub({point}, {self._pose(0.1)})",
            f"{point} = pose_trans(f1, {self._point()})",
            f"global {point} = {self._pose()}", f"home = {self._axes()}",
        )  # fmt: skip
