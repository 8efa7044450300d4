"""UR scripts by a seed: inline and stored poses, frames, tools, control flow."""

from __future__ import annotations

import numpy as np
from written import Job, Pen


def urscript(pen: Pen) -> Job:
    """One script; metres and radians."""
    pen.decimals, pen.turns = pen.decimals + 3, max(pen.turns, 6)
    lines = ["def part():", "  global speed = 0.25"]
    for k in range(pen.whole(1, 12)):
        lines += [pen.pick("", "  ", "\t") + line for line in _statement(pen, k)]
    body = [*lines, "end", "", "part()"][: pen.whole(3, 4) + len(lines) - 2 + 1]
    fine = 0.5 * 10.0**-pen.turns
    return Job(
        files=(("part.script", pen.encode(body)),),
        place=0.5 * 10.0**-pen.decimals,
        turn=3.0 * fine,
        bend=fine,
    )


def _pose(pen: Pen) -> str:
    turn = pen.rng.normal(size=3)
    turn *= pen.rng.choice([0.0, 0.1, 1.0, 3.0, np.pi - 1e-5, np.pi, 4.0]) / np.linalg.norm(turn)
    place = [pen.number(2.0, pen.decimals) for _ in range(3)]
    values = [*place, *(f"{value:.{pen.turns}f}" for value in turn)]
    return "p[" + pen.gap() + pen.pick(",", ", ", " , ").join(values) + pen.gap() + "]"


def _axes(pen: Pen) -> str:
    return "[" + ", ".join(f"{v:.{pen.turns}f}" for v in pen.rng.uniform(-3.0, 3.0, 6)) + "]"


def _statement(pen: Pen, k: int) -> list[str]:
    kind = pen.whole(0, 14)
    a, b = _pose(pen), _pose(pen)
    if kind <= 2:
        return [f"movel({a},1.2,{pen.pick('speed', '0.25')},0,0.001)"]
    if kind == 3:
        return [f"movej( {pen.pick(a, _axes(pen))}, a=1) # to {b} ("]
    if kind == 4:
        return [f"movec({a},{pen.pick('', ' ')}{b},1,0.1,0)"]
    if kind == 5:
        return [f"movep(pose={a})", f'textmsg("movel({k}")']
    if kind == 6:
        return [f"{pen.pick('global ', 'local ', '')}p{k} = {a}", f"movel(p{k}, a=1)"]
    if kind == 7:
        return [f"f{k}={a}", f"movel(pose_trans(f{k}, {b}))"]
    if kind == 8:
        return [f"set_tcp({a})", f"movel({b})"]
    if kind == 9:
        return ["if x > 1:", f"movel({a})", "elif y:", "sleep(1)", "else:", f"movel({b})", "end"]
    if kind == 10:
        return [f"movej(get_inverse_kin({a}),1)", f"p{k}=pose_add({a},{b})", f"movel(p{k})"]
    if kind == 11:
        return ["while True:", f"movel({a})", "break", "end", "# \xe4\xf6 (["]
    if kind == 12:
        return [f"def sub{k}(v):", f"movel({a}, v=v)", "return v", "end", f"sub{k}(1)"]
    if kind == 13:
        return [f"movel({a}); movel({b})", f"optimovel({a}, a=0.3)"]
    return ["set_standard_digital_out(1, True)", "", f"i{k} = {k}", "sleep(0.5)"]
