"""A job as CAM writes it: long, mixed, with everything that looks like a target and is none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from krl_samples import job, replacement, write

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG, MM
from robotrue.program.program import FrameTable, Motion, Program, Reason, Replacement

POINTS = 18_465
INLINE = 4_000


def cam_job() -> tuple[str, str]:
    rng = np.random.default_rng(11)
    xyz = rng.uniform(-900, 900, (POINTS + INLINE, 3))
    abc = rng.uniform([-180, -89, -180], [180, 89, 180], (POINTS + INLINE, 3))
    abc[::97, 1] = 90.0
    rows = np.column_stack([xyz, abc]).tolist()
    dat = ["&ACCESS RVP", "&REL 1", "DEFDAT  part PUBLIC", "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )"]
    dat.append(f"DECL GLOBAL FRAME gf[{POINTS}]")
    dat += [
        f"gf[{i + 1:<5d}]={{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.4f},B {b:.4f},C {c:.4f}}}"
        for i, (x, y, z, a, b, c) in enumerate(rows[:POINTS])
    ]
    dat += ["DECL LOAD l={M 50.0,CM {X 1,Y 2,Z 3,A 4,B 5,C 6},J {X 1,Y 2,Z 3}}", "ENDDAT"]
    src = [
        *("&ACCESS RVP", "DEF Part ( )", ";FOLD INI", "bas (#INITMOV,0 )", ";ENDFOLD (INI)"),
        "$BASE = {FRAME: X 800.000,Y -100.000,Z 450.000,A 15.000,B -0.000,C 0.000}",
        "$TOOL = {FRAME: X 0.000,Y 0.000,Z 215.500,A 0.000,B 30.000,C 0.000}",
        "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0,E1 0.0,E2 850.0}",
        *("SPINDLE_ON (18000)", "FOR i=1 TO 18465", "LIN gf[i] C_VEL", "ENDFOR"),
    ]
    for i, (x, y, z, a, b, c) in enumerate(rows[POINTS:]):
        pose = f"X {x:.3f},Y {y:.3f},Z {z:.3f},A {a:.3f},B {b:.3f},C {c:.3f}"
        rest = "E1 0.000,E2 850.000,E3 0.000,E4 0.000,E5 0.000,E6 0.000"
        if i % 20 == 0:
            src.append(f";FOLD block {i} {{{pose}}}")
            src.append(f"$VEL.CP={0.01 + i * 1e-5:.5f} ; m/s \xe4\xf6\xfc {{")
            src.append(f"ptp {{{pose},S'B010',T'B110101',{rest}}} C_PTP")
            src.append(";ENDFOLD")
        else:
            word = ("LIN", "lin", "Lin ")[i % 3]
            src.append(f"{word} {{{pose},{rest}}} C_DIS" + (" ; retract" if i % 7 == 0 else ""))
    return "\r\n".join([*src, "END", ""]), "\r\n".join([*dat, ""])


FRAMES = FrameTable(external_axes_at_rest=True, harmless_routines=("spindle_on",))


def planted(program: Program, seed: int) -> Replacement:
    rng = np.random.default_rng(seed)
    n = len(program)
    turn = matrix_from_abc(rng.normal(0.0, 0.05 * DEG, (n, 3)))
    return Replacement(
        changed=program.reason == Reason.NONE,
        position=program.position + rng.normal(0.0, 0.5 * MM, (n, 3)),
        rotation=program.rotation @ turn,
        axes=program.axes,
        words=np.stack([np.full(n, NO_WORD), np.where(program.words[:, 1] >= 0, 42, NO_WORD)], 1),
    )


def test_a_large_dirty_job(tmp_path: Path) -> None:
    source, points = job(tmp_path, *cam_job(), FRAMES)
    assert len(points) == POINTS
    assert (points.motion == Motion.LIN).all()
    assert (points.reason == Reason.NONE).all()
    assert len(source) == INLINE + 1
    assert source.reason.tolist() == [Reason.JOINT_TARGET] + [Reason.NONE] * INLINE
    assert (source.motion == Motion.PTP).sum() == 1 + INLINE // 20
    assert source.notes == ()
    for program in (source, points):
        assert write(program, replacement(program)).encode("latin-1") == program.data

    changes = [planted(source, 1), planted(points, 2)]
    texts = [write(p, c) for p, c in zip((source, points), changes, strict=True)]
    again = job(tmp_path, *texts, FRAMES)
    for new, change, digits in zip(again, changes, (3, 4), strict=True):
        use = change.changed
        half_mm = 0.5001 * 10.0**-digits
        error_mm = np.abs(new.position - change.position)[use] / MM
        error_deg = np.abs(new.rotation - change.rotation)[use] / DEG
        assert error_mm.max() <= half_mm
        assert error_deg.max() <= 3 * half_mm
    assert set(again[0].words[:, 1].tolist()) == {NO_WORD, 42}
    assert set(again[0].words[:, 0].tolist()) == {NO_WORD, 2}
    # Nothing but numbers of targets differs: comments, folds, frames, loads, line ends.
    for text, program in zip(texts, (source, points), strict=True):
        before = program.data.decode("latin-1").split("\r\n")
        after = text.split("\r\n")
        differing = [
            i + 1 for i, pair in enumerate(zip(before, after, strict=True)) if len({*pair}) > 1
        ]
        assert set(differing) <= set(program.line[program.reason == 0].tolist())
        assert len(differing) == int((program.reason == 0).sum())
