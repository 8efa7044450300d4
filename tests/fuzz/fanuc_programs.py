"""Fanuc LS programs by a seed: records as poses and joints, groups, arcs over lines."""

from __future__ import annotations

from written import Job, Pen


def fanuc(pen: Pen) -> Job:
    """One listing."""
    records: list[str] = []
    moves = ["UFRAME_NUM=1 ;", "UTOOL_NUM=1 ;"]
    for i in range(1, pen.whole(1, 10) + 1):
        records += _record(pen, i).split("\n")
        moves += _moves(pen, i)
    body = [f"{i:4d}:{each}" for i, each in enumerate(moves, 1)]
    head = ["/PROG  PART", "/ATTR", 'COMMENT\t\t= "\xe4";', f"LINE_COUNT\t= {len(body)};"]
    head += ["DEFAULT_GROUP\t= 1,*,*,*,*;", "/MN"]
    lines = [*head, *"\n".join(body).split("\n"), "/POS", *records, "/END"]
    return pen.abc_job(("part.ls", pen.encode(lines, mark=False)))


def _record(pen: Pen, index: int) -> str:
    axis = pen.chance(0.25)
    names = [f"J{i}" for i in range(1, 7)] if axis else list("XYZWPR")
    parts = []
    for i, name in enumerate(names):
        value = pen.place() if i < 3 and not axis else pen.angle()
        unit = "mm" if i < 3 and not axis else "deg"
        parts.append(
            f"{name} = {pen.pick('', '  ', '     ')}{value}  {unit}".replace(
                " =", pen.pick("=", " ="), 1
            )
        )
    told = "" if axis else f"\t\tCONFIG : '{_config(pen)}',"
    name = pen.pick("", "", ':"a"', ':"b; {c"')
    tail = pen.pick(
        "", "", "", ",\n\tE1=     0.000  mm", "\n   GP2:\n\tUF : 1, UT : 1,\n\tJ1= 0.000 deg"
    )
    frame = pen.pick("1", "2", "0", "F")
    rows = pen.pick(",\t", ",\n\t", ", ").join(parts)
    return f"P[{index}{name}]{{\n   GP1:\n    UF : {frame}, UT : 1,{told}\n\t{rows}{tail}\n}};"


def _config(pen: Pen) -> str:
    turns = ", ".join(str(pen.whole(-1, 1)) for _ in range(3))
    return f"{pen.pick('N', 'F')} {pen.pick('U', 'D')} {pen.pick('T', 'B')}, {turns}"


def _moves(pen: Pen, i: int) -> list[str]:
    kind, move = (
        pen.whole(0, 12),
        f"P[{i}] {pen.pick('200mm/sec', '10cm/min')} {pen.pick('CNT1', 'FINE')} ;",
    )
    if kind <= 3:
        return [f"L {move}"]
    if kind == 4:
        timed = ["  1:  TC_ONLINE (ON) ;", "   ------ ;"] if pen.chance(0.3) else []
        return [f"J P[{i}] 4% CNT100{' ACC50 TB  .10sec,P-SPS' if timed else ''} ;", *timed]
    if kind == 5:
        return [f"A {move}"]
    if kind == 6:
        return [f"C P[{max(i - 1, 1)}]    \n  {move}"]
    if kind == 7:
        return [f"! L {move}", f"//L {move}", f"L {move}"]
    if kind == 8:
        return [f"L P[{i}:x] 5mm/sec FINE Offset,PR[1] ;", "  CALL SUB ;",
                f"Touch Offset PR[{i}] ;", f"L {move}", "Touch Offset End ;"]  # fmt: skip
    if kind == 10:
        return [f"PR[{i}]=P[{i}] ;", f"PR[{i},3]=PR[{i},3]+{pen.whole(0, 9)} ;",
                f"L PR[{i}] 5mm/sec FINE ;", f"L {move}"]  # fmt: skip
    if kind == 11:
        return ["PR[90]=LPOS-LPOS ;", f"PR[90,{pen.whole(1, 3)}]=({pen.whole(-9, 9)}) ;",
                f"L P[{i}] 5mm/sec FINE {pen.pick('', 'Tool_')}Offset,PR[90] ;",
                *([f"L {move}"] if pen.chance(0.5) else [])]  # fmt: skip
    if kind == 12:
        return [f"IF DI[{i}]=ON,JMP LBL[{i}] ;", f"PR[90,1]={i} ;", f"LBL[{i}] ;",
                f"J P[{i}:x] 4% FINE Offset,PR[90] ;"]  # fmt: skip
    return ["  DO[5]=ON ;", "  WAIT   .50(sec) ;", f"S {move}", "  LBL[1] ;"]
