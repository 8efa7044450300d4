"""Yaskawa jobs by a seed: poses in three frames, pulses, angles, modal headers, counts."""

from __future__ import annotations

from written import RATIOS, Job, Pen

from robotrue.core.units import DEG, MM

HEADERS = {
    "pose": (["///POSTYPE BASE", "///RECTAN"], ["///USER 2", "///POSTYPE USER", "///RECTAN "],
             ["///USER 1", "///POSTYPE USER", "///RECTAN"], ["///POSTYPE ROBOT", "///RECTAN"]),
    "pulse": (["///POSTYPE PULSE", "///PULSE"], ["///PULSE"]),
    "angle": (["///POSTYPE ANGLE", "///ANGLE"],),
}  # fmt: skip


def jbi(pen: Pen) -> Job:
    """One job."""
    points, moves, count = [f"///TOOL {pen.whole(1, 2)}"], [], 0
    for _ in range(pen.whole(1, 4)):
        kind = pen.pick("pose", "pose", "pose", "pulse", "angle")
        header = HEADERS[kind]
        points += header[pen.whole(0, len(header) - 1)]
        if kind == "pose":
            points.append("///RCONF " + ",".join(str(pen.whole(0, 1)) for _ in range(_fields(pen))))
        for _ in range(pen.whole(0, 5)):
            name = pen.pick("C", "C", "P") + f"{count:05d}"
            points.append(f"{name}={pen.pick(',', ',', ', ').join(_values(pen, kind))}")
            moves += _moves(pen, name)
            count += 1
    lines = ["/JOB", "//NAME PART", "//POS", f"///NPOS {count},0,0,0,0,0", *points, "//INST"]
    lines += ["///DATE 2026/11/21 08:11", "///COMM \xe4", "///ATTR SC,RW,RJ", "///GROUP1 RB1"]
    lines += ["NOP", *moves, "END"]
    fine = 0.5 * 10.0**-pen.turns * DEG
    return Job(
        files=(("part.jbi", pen.encode(lines, mark=False)),),
        place=0.5 * 10.0**-pen.decimals * MM,
        turn=3.0 * fine,
        bend=max(fine, 0.5 / float(abs(RATIOS).min()) * DEG),
    )


def _fields(pen: Pen) -> int:
    return (6, 8, 24)[pen.whole(0, 2)]


def _values(pen: Pen, kind: str) -> list[str]:
    if kind == "pulse":
        return [str(pen.whole(-100_000, 100_000)) for _ in range(6)]
    if kind == "angle":
        return [pen.angle() for _ in range(6)]
    return [pen.place() for _ in range(3)] + [pen.angle() for _ in range(3)]


def _moves(pen: Pen, name: str) -> list[str]:
    kind = pen.whole(0, 9)
    if kind <= 4:
        return [f"MOV{pen.pick('L', 'L', 'J', 'S')} {name} {pen.pick('V=200.0', 'VJ=50.00')} PL=1"]
    if kind == 5:
        return [f"MOVC {name} V=200.0 PL=1"]
    if kind == 6:
        return [f"MOVL {name}  V=200.0  // x", f"'MOVL {name} {{ \xe4"]
    if kind == 7:
        return [f"MOVL {name} V=99.5", f"MOVJ {name} VJ=10"]
    if kind == 8:
        return ["DOUT OT#(1) ON", "TIMER T=0.50", f"*L{pen.whole(0, 99)}"]
    return [f"MOVL {name} V=200.0 +MOVL {name}"]
