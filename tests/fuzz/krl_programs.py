"""KRL programs by a seed: source and data list, every form of target, frames, control flow."""

from __future__ import annotations

from written import Job, Pen


def krl(pen: Pen) -> Job:
    """A ``.src``, most often with a ``.dat`` beside it."""
    data = ["&ACCESS RVP", "DEFDAT part PUBLIC", "EXT BAS (BAS_COMMAND :IN,REAL :IN )"]
    body = ["&ACCESS RVP", "&REL 7", "DEF part( )", *_frames(pen)]
    for k in range(pen.whole(1, 12)):
        body += _statement(pen, k, data)
    body += ["END", *_more(pen)]
    files = [("part.src", pen.encode(body))]
    if len(data) > 3 or pen.chance(0.3):
        files.append(("part.dat", pen.encode([*data, "ENDDAT"])))
    pen.turns = min(pen.turns, pen.decimals)  # words put in are printed like those beside them
    return pen.abc_job(*files)


def _pose(pen: Pen, *, words: bool = True) -> str:
    names = [pen.case(name) for name in "XYZABC"]
    values = [pen.place() for _ in range(3)] + [pen.angle() for _ in range(3)]
    parts = [f"{name}{pen.blank()}{value}" for name, value in zip(names, values, strict=True)]
    if words and pen.chance(0.3):
        parts += [
            pen.pick("S 2", "S'B010'", "s 6", "S 'B 010'"),
            pen.pick("T 35", "T'B110101'", "T'H2'"),
        ]
    if words and pen.chance(0.2):
        parts += ["E1 0.0", pen.pick("E2 -0.000", "E2 0")]
    head = pen.pick("", "", "", "E6POS: ", "POS:", "FRAME: ") if words else pen.pick("", "FRAME: ")
    return "{" + head + pen.pick(",", ", ", " ,").join(parts) + pen.gap() + "}"


def _axis(pen: Pen) -> str:
    values = [f"{pen.case(f'A{i}')}{pen.blank()}{pen.angle()}" for i in range(1, 7)]
    return "{" + pen.pick("", "AXIS: ", "E6AXIS: ") + ",".join(values) + "}"


def _frames(pen: Pen) -> list[str]:
    return [
        f"$BASE{pen.gap()}={pen.gap()}{_pose(pen, words=False)}",
        f"$TOOL={_pose(pen, words=False)}",
    ][: pen.whole(0, 2)]


def _tail(pen: Pen) -> str:
    return pen.pick("", " C_DIS", " C_VEL", "  C_ORI", " ; fast {X 1,", " C_DIS ;\xe4")


def _statement(pen: Pen, k: int, data: list[str]) -> list[str]:
    kind, lead = pen.whole(0, 17), pen.pick("", "", "  ", "\t")
    a, b = _pose(pen), _pose(pen)
    if kind <= 3:
        return [f"{lead}{pen.case('LIN')} {a}{_tail(pen)}"]
    if kind == 4:
        return [f"{lead}{pen.case('PTP')} {pen.pick(a, _axis(pen))}{pen.pick('', ' C_PTP')}"]
    if kind == 5:
        return [f"CIRC {a},{pen.gap()}{b}{pen.pick('', ', CA 90.0')}{_tail(pen)}"]
    if kind == 6:
        data.append(f"DECL {pen.pick('E6POS', 'POS', 'GLOBAL FRAME')} XP{k}={a}")
        fold = [f";FOLD LIN P{k} CONT Vel=2 m/s CPDAT{k} Tool[1] Base[1];%{{PE}}%R 8.3.42", "x=1"]
        return [*fold[: 2 * pen.whole(0, 1)], f"{lead}LIN XP{k} C_DIS", ";ENDFOLD"]
    if kind == 7:
        n = pen.whole(1, 4)
        data.append(f"DECL FRAME gf{k}[{n}]")
        data.extend(f"gf{k}[{i + 1}{pen.gap()}]={pen.gap()}{_pose(pen)}" for i in range(n))
        return [f"FOR i=1 TO {n}", f"LIN gf{k}[i] C_VEL", "ENDFOR"]
    if kind == 8:
        data.append(f"gs{k}[1]{pen.gap()}={{fCnC {a}, grFeedrate 3000}}")
        return [f"LIN gs{k}[1].{pen.pick('fCnC', 'fcnc', 'FCNC')} C_DIS"]
    if kind == 9:
        return [f"c{k}={a}", f"PTP c{k}"]
    if kind == 10:
        line = "SPLINE", f"SPL {a}", f"SLIN {b} WITH $VEL.CP=0.2", "ENDSPLINE"
        return list(line)
    if kind == 11:
        return [f"IF $IN[{k}] THEN", f"LIN {a}", "ELSE", f"LIN {b}", "ENDIF"]
    if kind == 12:
        return [pen.pick("BAS(#BASE,1)", "BAS (#TOOL,2 )", "$BASE=BASE_DATA[2]", "$BASE=$NULLFRAME",
                         f"$BASE={_pose(pen, words=False)}", f"BASE_DATA[1]={a}",
                         "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}")]  # fmt: skip
    if kind == 13:
        return [f"LIN {{{pen.pick('X', 'y', 'Z')} {pen.place()}}}", f"LIN_REL {{Z {pen.place()}}}"]
    if kind == 14:
        return [f"; LIN {a}", "$OUT[5]=TRUE", "WAIT SEC 0.5", "$VEL.CP = .25", ""]
    if kind == 15 and pen.chance(0.5):
        return ["LOOP", f"LIN {a}", "EXIT", "ENDLOOP", "REPEAT", f"SLIN {b}", "UNTIL TRUE"]
    if kind == 15:
        return [f"GOTO s{k}", f"LIN {a}", f"s{k}:", f"LIN {b}", f"CIRC {a}"]
    if kind == 16:
        return [f"LIN {a}:{b}", f"p{k}.X = p{k}.X+5", f"LIN p{k}", "sub()"]
    return ["SWITCH n", "CASE 1,2", f"LIN {a}", "DEFAULT", f"SCIRC {a},{b}", "ENDSWITCH"]


def _more(pen: Pen) -> list[str]:
    return [] if pen.chance(0.6) else ["DEF sub()", f"LIN {_pose(pen)}", "RETURN", "END"]
