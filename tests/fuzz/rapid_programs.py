"""RAPID modules by a seed: inline, declared, in arrays; tools and work objects; control flow."""

from __future__ import annotations

import numpy as np
from written import Job, Pen

from robotrue.core.units import DEG, MM

HEAD = """MODULE part
PERS tooldata t1:=[TRUE,[[0,0,215.5],[0.96592583,0,0.25881905,0]],[2,[0,0,15],[1,0,0,0],0,0,0]];
PERS wobjdata w1:=[FALSE,TRUE,"",[[800,-100,450],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
VAR speeddata v1:=[250,500,5000,1000];"""


def rapid(pen: Pen) -> Job:
    """One module."""
    pen.turns = max(pen.turns, 6)
    data, code = [], []
    for k in range(pen.whole(1, 12)):
        stored, lines = _statement(pen, k)
        data += stored
        code += lines
    body = [*HEAD.split("\n"), *data, pen.pick("PROC main()", "LOCAL PROC main( \\num n)")]
    body += [*code, "ENDPROC", *_more(pen), "ENDMODULE"]
    mark = b"%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\n\n" if pen.chance(0.3) else b""
    data_bytes = (pen.mark or mark.replace(b"\n", pen.end.encode())) + pen.encode(body, mark=False)
    turn = 0.5 * 10.0**-pen.turns
    return Job(
        files=(("part.mod", data_bytes),),
        place=0.5 * 10.0**-pen.decimals * MM,
        turn=8.0 * turn,
        bend=0.5 * 10.0**-pen.turns * DEG,
    )


def _row(pen: Pen, values: list[str]) -> str:
    comma = pen.pick(",", ",", ", ", " ,", ",\n  ")
    return "[" + pen.gap() + comma.join(values) + pen.gap() + "]"


def _target(pen: Pen) -> str:
    q = pen.rng.normal(size=4) if pen.chance(0.85) else np.array([1.0, 0.0, -0.0, 0.0])
    q = q / np.linalg.norm(q)
    free = pen.pick("9E9", "9E+09", "9E+9", "9E9", "0", "0.0")
    rows = [
        [pen.place() for _ in range(3)],
        [f"{value:.{pen.turns}f}" for value in q],
        [str(value) for value in pen.rng.integers(-2, 3, 4)],
        [free] * 6,
    ]
    return "[" + ",".join(_row(pen, row) for row in rows) + "]"


def _axes(pen: Pen) -> str:
    values = [f"{v:.{pen.turns}f}" for v in pen.rng.uniform(-90.0, 90.0, 6)]
    return f"[{_row(pen, values)},{_row(pen, ['9E9'] * 6)}]"


def _tail(pen: Pen) -> str:
    return pen.pick(
        ",v1,z1,t1\\WObj:=w1;",
        "\\ID:=0,v100,fine,T1,\\wobj:=W1;",
        ", v1 , z1, tool2 \\WObj:=wobj2 ; ! \xe4 [1,2",
        "\\V:=200,z1,t1\\WObj:=w1;",
        ",v1\\T:=2,z5,t1;",
    ).replace("\\V", ",v1\\V", 1)


def _statement(pen: Pen, k: int) -> tuple[list[str], list[str]]:
    kind, lead = pen.whole(0, 14), pen.pick("", "    ", "\t")
    a, b, tail = _target(pen), _target(pen), _tail(pen)
    if kind <= 2:
        return [], [f"{lead}{pen.case('MoveL')} {a}{tail}"]
    if kind == 3:
        return [], [f"{lead}{pen.case('MoveJ')} {a}{tail}"]
    if kind == 4 and pen.chance(0.3):
        end = ",v1,seam,weld\\Weave:=w,fine,t1\\WObj:=w1;"
        return [], [f"ArcLStart {a}{end}", f"ArcC {a},{b}{end}", f"ArcLEnd {b}{end}"]
    if kind == 4:
        return [], [f"MoveC {a},{pen.gap()}{b}{tail}"]
    if kind == 5:
        word = pen.pick("CONST", "PERS", "VAR", "LOCAL CONST", "TASK PERS")
        name = pen.pick("p", "\xf6p", "p\xd6") + str(k)
        return [f"{word} robtarget {name}:={a};"], [f"MoveL {name}{tail}"]
    if kind == 6:
        rows = f"[{a},{b}]"
        return [f"CONST robtarget p{k}{{2}}:={rows};"], [
            f"FOR i FROM 1 TO 2 DO MoveL p{k}{{i}}{tail} ENDFOR"
        ]
    if kind == 7:
        return [f"VAR robtarget p{k};"], [f"p{k}:={a};", f"MoveL p{k}{tail}"]
    if kind == 8:
        end = tail.removeprefix(",") if tail.startswith(",v") else "v1,z1,t1;"
        return [], [f"MoveAbsJ {_axes(pen)}{pen.pick('', chr(92) + 'NoEOffs')},{end}"]
    if kind == 9:
        return [f"CONST robtarget p{k}:={a};"], [f"MoveL Offs(p{k},0,0,5){tail}",
                                                f"MoveL RelTool(p{k},1,2,3){tail}"]  # fmt: skip
    if kind == 10:
        return [], [f"IF n>{k} THEN", f"MoveL {a}{tail}", "ELSE", f"MoveL {b}{tail}", "ENDIF"]
    if kind == 11:
        return [], [f"w1.uframe:=[[1,2,{k}],[1,0,0,0]];", f"MoveL {a}{tail}"]
    if kind == 12:
        return [], [f'TPWrite "MoveL ""{k}"" [";', "! MoveL [[1,2,3],[1,0,0,0]", "ConfL \\Off;",
                    "WaitTime 0.5;", ""]  # fmt: skip
    if kind == 13:
        return [], [f"TEST n CASE 1,2: MoveL {a}{tail}", f"DEFAULT: MoveL {b}{tail}", "ENDTEST"]
    return [], ["PDispOn \\Rot,p1,t1;", f"MoveL {a}{tail}", "PDispOff;", "sub;"]


def _more(pen: Pen) -> list[str]:
    return [] if pen.chance(0.6) else ["PROC sub()", f"MoveL {_target(pen)}{_tail(pen)}", "ENDPROC"]
