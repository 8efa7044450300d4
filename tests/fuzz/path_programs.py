"""Programs of points as words by a seed: G-code of two makers, Heidenhain, APT/CL and CSV."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from written import TABLE, Job, Pen

from robotrue.core.units import DEG, MM
from robotrue.program.orientation import OrientationRule

PATHS = replace(
    TABLE,
    bases={"G54": np.eye(4), "G55": np.eye(4), "0": np.eye(4)},
    tools={"T1": np.eye(4)},
    orientation=OrientationRule(angles="rpy", spin=20.0 * DEG),
)


def _job(pen: Pen, name: str, lines: list[str], *, mark: bool = False) -> Job:
    """Numbers put in or widened are printed as finely as those around them, or finer."""
    least = min(pen.decimals, pen.turns)
    fine = 0.5 * 10.0**-least
    return Job(
        files=((name, pen.encode(lines, mark=mark)),),
        place=0.5 * 10.0**-pen.decimals * MM,
        turn=np.inf,
        via=False,
        bend=fine * DEG,
        frames=PATHS,
    )


def _short(pen: Pen, text: str) -> str:
    """A number as posts print it: without the zero before the point or those at the end."""
    if pen.chance(0.2):
        text = text.replace("0.", ".", 1) if text.lstrip("+-").startswith("0.") else text
    return text


def _axis(pen: Pen) -> list[str]:
    v = pen.rng.normal(size=3) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
    return [f"{value:.{max(pen.turns, 6)}f}" for value in v / np.linalg.norm(v)]


def _places(pen: Pen, names: str, *, some: bool = True) -> str:
    chosen = [n for n in names if not some or pen.chance(0.75)] or [names[0]]
    return " ".join(f"{n}{pen.gap() if pen.chance(0.05) else ''}{_short(pen, pen.place())}"
                    for n in chosen)  # fmt: skip


def _numbered(pen: Pen, lines: list[str]) -> list[str]:
    step = pen.whole(0, 10)
    return lines if not step else [
        f"N{(k + 1) * step} {line}" if line and line[0] not in ";%(O" else line
        for k, line in enumerate(lines)
    ]  # fmt: skip


def sinumerik(pen: Pen) -> Job:
    """Siemens G-code."""
    lines = ["G17 G710 G40 G90", "T1 D1", "G54 G64", "TRAORI"]
    lines.append(f"G0 {_places(pen, 'XYZ', some=False)} A={pen.angle()} B={pen.angle()} C=0.000 M3")
    for _ in range(pen.whole(2, 14)):
        kind = pen.whole(0, 13)
        p = _places(pen, "XYZ")
        if kind <= 4:
            lines.append(f"{pen.pick('G1 ', '')}{p}{pen.pick('', ' F1000.0', ' A=' + pen.angle())}")
        elif kind == 5:
            lines.append(f"G1 {p} A={pen.angle()} B={pen.angle()} C={pen.angle()} ; go X1")
        elif kind == 6:
            a, b, c = _axis(pen)
            lines.append(f"G1 A3={a} B3={b} C3={c} {p}")
        elif kind == 7:
            lines.append(f"CIP {_places(pen, 'XYZ', some=False)} I1={pen.place()} J1={pen.place()} "
                         f"K1={pen.place()}")  # fmt: skip
        elif kind == 8:
            lines.append(f"{pen.pick('G2', 'G3')} {_places(pen, 'XY', some=False)} CR=5000.0")
        elif kind == 9:
            lines += [f"G91 {p}", f"G90 {_places(pen, 'XYZ', some=False)}"]
        elif kind == 10:
            lines += ["TRANS X10", f"G1 {p}", "TRANS", f"G1 {_places(pen, 'XYZ', some=False)}"]
        elif kind == 11:
            lines += [f"X=R1+5 {p.replace('X', 'Y')}", f"G1 {_places(pen, 'XYZ', some=False)}"]
        elif kind == 12:
            lines.append(f"G1 {' '.join(f'JT{i}={pen.angle()}' for i in range(1, 7))}")
        else:
            lines += ["; X1 Y2 \xe4", "M8", "", f"{pen.pick('G55', 'G54')}"]
    return _job(pen, "part.mpf", [*_numbered(pen, lines), "M30"])


def fanuc_gcode(pen: Pen) -> Job:
    """Fanuc G-code."""
    lines = ["G21 G17 G40 G49 G80 G90", "T1 M6", "G54", pen.pick("G43.4 H1", "G43.5 H1")]
    by_axis = lines[-1].startswith("G43.5")
    a, b, c = _axis(pen)
    turn = f"I{a} J{b} K{c}" if by_axis else f"A{pen.angle()} B{pen.angle()} C{pen.angle()}"
    lines.append(f"G0 {_places(pen, 'XYZ', some=False)} {turn} M3 S5000")
    for _ in range(pen.whole(2, 14)):
        kind, p = pen.whole(0, 10), _places(pen, "XYZ")
        a, b, c = _axis(pen)
        word = f" I{a} J{b} K{c}" if by_axis else f" {pen.pick('A', 'B', 'C')}{pen.angle()}"
        if kind <= 4:
            lines.append(f"{pen.pick('G1 ', '')}{p}{pen.pick('', ' F1000.', '(GO X1)')}")
        elif kind <= 6:
            lines.append(f"G1 {p}{word}")
        elif kind == 7:
            lines += [f"G1 X#100 {p.replace('X', 'Y')}", f"G1 {_places(pen, 'XYZ', some=False)}"]
        elif kind == 8:
            lines += [f"G91 {p}", f"G90 {_places(pen, 'XYZ', some=False)}"]
        elif kind == 9 and not by_axis:
            lines.append(f"{pen.pick('G2', 'G3')} {_places(pen, 'XY', some=False)} R5000.")
        else:
            lines += ["(X1 Y2 \xe4)", "M98 P100", f"G1 {_places(pen, 'XYZ', some=False)}{word}"]
    return _job(pen, "part.nc", ["%", "O1000 (PART)", *_numbered(pen, lines), "M30", "%"])


def heidenhain(pen: Pen) -> Job:
    """Conversational blocks."""
    lines = ["BEGIN PGM PART MM", "BLK FORM 0.1 Z X-50 Y-50 Z-20", "TOOL CALL 1 Z S5000"]
    lines += [pen.pick("M128", "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS"),
              f"L {_signed(pen, 'XYZ')} A+0 B{_plus(pen.angle())} C+90 R0 FMAX M3"]  # fmt: skip
    for _ in range(pen.whole(2, 14)):
        kind, p = pen.whole(0, 8), _signed(pen, pen.pick("XYZ", "X", "YZ", "Z"))
        if kind <= 3:
            lines.append(f"L {p}{pen.pick('', ' F1000', ' R0 FMAX', ' ; X1')}")
        elif kind == 4:
            lines.append(f"L {p} A{_plus(pen.angle())} C{_plus(pen.angle())}")
        elif kind == 5:
            a, b, c = (_plus(v) for v in _axis(pen))
            lines.append(f"LN {_signed(pen, 'XYZ')} TX{a} TY{b} TZ{c} F1000")
        elif kind == 6:
            turn = pen.pick("+", "-")
            lines += [f"CC X{_plus(pen.place())} Y+0", f"C {_signed(pen, 'XY')} DR{turn}"]
            lines.append(f"L {_signed(pen, 'XYZ')}")
        elif kind == 7:
            lines += [f"L IX{_plus(pen.place())}", "L X+Q1", f"L {_signed(pen, 'XYZ')}"]
        else:
            lines += ["; X+1", "M8", "CYCL DEF 32.0 TOLERANCE"]
    lines += ["M129", "L Z+100 R0 FMAX", "END PGM PART MM"]
    return _job(pen, "part.h", [f"{k} {line}" for k, line in enumerate(lines)])


def _plus(text: str) -> str:
    return text if text[0] in "+-" else "+" + text


def _signed(pen: Pen, names: str) -> str:
    return " ".join(f"{n}{_plus(pen.place())}" for n in names)


def apt(pen: Pen) -> Job:
    """CL data."""
    lines = ["PARTNO X", "UNITS/MM", "LOADTL/1", "MULTAX"]
    for _ in range(pen.whole(2, 14)):
        kind, p = pen.whole(0, 9), pen.pick(",", ", ", ",  ").join(pen.place() for _ in range(3))
        if kind <= 3:
            lines.append(f"{pen.case('GOTO')}{pen.pick('', '  ')}/{pen.gap()}{p}")
        elif kind <= 6:
            lines.append(f"GOTO/{p},{pen.pick('', '$' + chr(10) + ' ')}{','.join(_axis(pen))}")
        elif kind == 7:
            lines += [f"GODLTA/{pen.place()},0,0", f"GOTO/{p},{','.join(_axis(pen))}"]
        elif kind == 8:
            lines += [f"CIRCLE/{p},0,0,1,5", f"GOTO/{p}", "RAPID", "FEDRAT/ 300.0,MMPM"]
        else:
            lines += ["$$ GOTO/1,2,3", "PPRINT GOTO/1,2,3 \xe4", "TRANS/1,0,0", f"GOTO/{p}",
                      "TRANS/0,0,0", f"GOTO/{p}", ""]  # fmt: skip
    return _job(pen, "part.apt", [*lines, "FINI"], mark=True)


def toolpath_csv(pen: Pen) -> Job:
    """A table of points."""
    mark = pen.pick(",", ";")
    names = ["x_mm", "y_mm", "z_mm", *(["i", "j", "k"] if pen.chance(0.7) else [])]
    names += ["rapid"] if pen.chance(0.4) else []
    if pen.chance(0.3):
        pen.rng.shuffle(names)
    lines = ["# side A"] if pen.chance(0.3) else []
    lines.append(mark.join(pen.case(name) for name in names))
    for _ in range(pen.whole(1, 20)):
        cells = dict(zip("ijk", _axis(pen), strict=True)) | {"rapid": pen.pick("0", "1", "")}
        cells |= {name: pen.place() for name in names[: len(names)] if name.endswith("mm")}
        lines.append(mark.join(pen.pick("{}", "{}", '"{}"', "{} ").format(cells[n]) for n in names))
    return _job(pen, "part.csv", lines, mark=True)
