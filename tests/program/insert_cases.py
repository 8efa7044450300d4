"""One path in every dialect that targets are put into: four lines, an arc, a move of given time.

P[0] is reached by a joint move; P[1], P[2], P[3] by lines, of which the second stops; the arc goes
over P[4] to P[5]; the last line cannot be repeated where the dialect can say so. In KRL and RAPID
some of the targets are stored.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import inverse
from robotrue.core.rotations import (
    abc_from_matrix,
    quat_wxyz_from_matrix,
    rotation_vector_from_matrix,
)
from robotrue.core.units import DEG, MM
from robotrue.program.insertion import Insertion
from robotrue.program.lang import find_inserter, find_language
from robotrue.program.program import FrameTable, Motion, Program

DIALECTS = ("krl", "rapid", "urscript", "jbi", "fanuc_ls")
OFFSETS = np.array(
    [[-150, 0, 0], [150, 0, 0], [150, 100, 0], [150, 100, 100], [0, 200, 100], [-150, 100, 100],
     [-150, 100, 0]]
) * MM  # fmt: skip


def poses(T_base_tool: np.ndarray) -> np.ndarray:
    """The path (7, 4, 4) in the base, around a pose and with its orientation."""
    out = np.tile(T_base_tool, (len(OFFSETS), 1, 1))
    out[:, :3, 3] += OFFSETS
    return out


def _numbers(T: np.ndarray, decimals: int) -> tuple[list[str], list[str]]:
    abc = abc_from_matrix(T[:3, :3]) / DEG
    return [f"{v:.{decimals}f}" for v in T[:3, 3] / MM], [f"{v:.6f}" for v in abc]


def krl(path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    def braces(T: np.ndarray, names: str = "XYZABC") -> str:
        place, turn = _numbers(T, 6)
        values = zip("XYZABC", [*place, *turn], strict=True)
        return "{" + ",".join(f"{n} {v}" for n, v in values if n in names) + "}"

    P = inverse(frame) @ path
    src = [
        "&ACCESS RVP", "DEF part( )", f"$BASE={braces(frame)}", f"$TOOL={braces(tool)}",
        f"PTP {braces(P[0])}", f"LIN {braces(P[1])} C_DIS ; cut", f"  LIN {braces(P[2])}",
        "$VEL.CP=0.2", "LIN XP3 C_DIS", f"CIRC XP4,{braces(P[5])} C_DIS",
        f"LIN {braces(P[6], 'XYZ')}", "END", "",
    ]  # fmt: skip
    dat = [
        "DEFDAT part", f"DECL E6POS XP3={braces(P[3])[:-1]},S 2,T 35,E1 0.0,E2 0.0}}",
        f"DECL FRAME XP4={braces(P[4])}", "ENDDAT", "",
    ]  # fmt: skip
    return {"part.src": "\r\n".join(src).encode(), "part.dat": "\r\n".join(dat).encode()}


def rapid(path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    def pose(T: np.ndarray) -> str:
        quat = quat_wxyz_from_matrix(T[:3, :3])
        place = ",".join(_numbers(T, 6)[0])
        return f"[{place}],[" + ",".join(f"{v:.9f}" for v in quat) + "]"

    P = [f"[{pose(T)},[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]" for T in inverse(frame) @ path]
    near, stop = "v100,z10,cutter\\WObj:=fix;", "v100,fine,cutter\\WObj:=fix;"
    text = f"""MODULE part
  PERS tooldata cutter:=[TRUE,[{pose(tool)}],[2,[0,0,15],[1,0,0,0],0,0,0]];
  PERS wobjdata fix:=[FALSE,TRUE,"",[{pose(frame)}],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p3:={P[3]};
  CONST robtarget a{{2}}:=[{P[4]},{P[5]}];
PROC main()
  MoveJ {P[0]},{near}
  MoveL {P[1]},{near}
  MoveL {P[2]},{stop} ! hold
  SetDO do1,1;
  MoveL p3,{near}
  MoveC a{{1}},a{{2}},{stop}
  MoveL {P[6]},v100\\T:=3,{near[5:]}
ENDPROC
ENDMODULE
"""
    return {"part.mod": text.encode()}


def urscript(path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    def pose(T: np.ndarray) -> str:
        vector = rotation_vector_from_matrix(T[:3, :3])
        return "p[" + ", ".join(f"{v:.8f}" for v in (*T[:3, 3], *vector)) + "]"

    P = [pose(T) for T in path]
    text = f"""def part():
  set_tcp({pose(tool)})
  via = {P[4]}
  movej(get_inverse_kin({P[0]}), a=1.4, v=1.05)
  movel({P[1]}, a=1.2, v=0.25, r=0.002)
  movel({P[2]}, a=1.2, v=0.25) # stop
  movel({P[3]}, 1.2, 0.25, 0, 0.001)
  movec(via, {P[5]}, a=1.2, v=0.25, r=0.001)
  movel({P[6]}, a=1.2, v=0.25, t=3)
end
part()
"""
    return {"part.script": text.encode()}


def jbi(path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    del tool
    lines = [
        "/JOB", "//NAME A", "//POS", "///NPOS 7,0,0,1,0,0", "///USER 1", "///TOOL 1",
        "///POSTYPE USER", "///RECTAN", "///RCONF 0,0,0,0,0,0,0,0",
    ]  # fmt: skip
    for number, T in enumerate(inverse(frame) @ path):
        place, turn = _numbers(T, 6)
        lines.append(f"C{number:05d}=" + ",".join([*place, *turn[::-1]]))
    lines += [
        "///POSTYPE PULSE", "///PULSE", "P00001=0,0,0,0,0,0", "//INST",
        "///DATE 2026/11/21 08:11", "///ATTR SC,RW", "///GROUP1 RB1", "NOP",
        "MOVJ C00000 VJ=5.0", "MOVL C00001 V=20.0 PL=1", "MOVL C00002 V=20.0 PL=0",
        "DOUT OT#(1) ON", "MOVC C00003 V=20.0 PL=1", "MOVC C00004 V=20.0 PL=1 'over it",
        "MOVC C00005 V=20.0 PL=0", "MOVL C00006 V=20.0 NWAIT", "END", "",
    ]  # fmt: skip
    return {"part.jbi": "\r\n".join(lines).encode()}


def fanuc_ls(path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    del tool
    lines = [
        "/PROG A", "/ATTR", "LINE_COUNT\t= 9;", "/MN", "   1:J P[1] 5% FINE ;", "   2:  !hello ;",
        "   3:L P[2] 200mm/sec CNT60 ;", "   4:L P[3] 200mm/sec FINE ;",
        "   5:L P[4] 200mm/sec CNT60 ;", "   6:C P[5] ", "      P[6] 200mm/sec CNT10 ;",
        "   7:L P[7] 2.0sec CNT10 ;", "   8:  DO[1]=ON ;", "   9:J P[1] 5% FINE ;", "/POS",
    ]  # fmt: skip
    for number, T in enumerate(inverse(frame) @ path, 1):
        place, turn = _numbers(T, 6)
        values = zip("XYZWPR", [*place, *turn[::-1]], strict=True)
        parts = [f"{n} = {v:>12s} {'mm' if n in 'XYZ' else 'deg'}" for n, v in values]
        lines += [
            f"P[{number}]{{", "   GP1:", "\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',",
            "\t" + ",\t".join(parts[:3]) + ",", "\t" + ",\t".join(parts[3:]), "};",
        ]  # fmt: skip
    return {"part.ls": "\n".join([*lines, "/END", ""]).encode()}


def files_of(name: str, path: np.ndarray, frame: np.ndarray, tool: np.ndarray) -> dict[str, bytes]:
    return globals()[name](path, frame, tool)


def reader(name: str, files: dict[str, bytes], frame: np.ndarray, tool: np.ndarray):
    """Reads the job, with other bytes for some of its files where given."""
    table = FrameTable(bases={"1": frame}, tools={"1": tool})

    def read(new: dict[str, bytes] | None = None) -> tuple[Program, ...]:
        given = [(each, (new or {}).get(each, data)) for each, data in files.items()]
        return find_language(name).read_job(given, frames=table)

    return read


def halves(name: str, job: tuple[Program, ...]) -> Insertion:
    """The middle of every line that may be split, and a quarter turn put before every arc."""
    moves = find_inserter(name).moves(job)
    position = np.concatenate([program.position for program in job])
    rotation = np.concatenate([program.rotation for program in job])
    words = np.concatenate([program.words for program in job])
    rows: list[tuple[int, int, np.ndarray, int]] = []
    for move in np.flatnonzero(moves.obstacle == 0).tolist():
        start, via, end = (int(each[move]) for each in (moves.start, moves.via, moves.end))
        if via < 0:
            rows.append((move, Motion.LIN, (position[start] + position[end]) / 2.0, end))
        else:
            rows.append((move, Motion.ARC_VIA, position[start] + 1e-3, end))
            rows.append((move, Motion.ARC_END, position[start] + 2e-3, end))
    ends = [row[3] for row in rows]
    return Insertion(
        move=np.array([row[0] for row in rows], dtype=np.int64),
        motion=np.array([row[1] for row in rows], dtype=np.int64),
        position=np.array([row[2] for row in rows]).reshape(-1, 3),
        rotation=rotation[ends],
        words=np.full((len(rows), words.shape[1]), NO_WORD),
    )


def shifted(insertion: Insertion, **columns: np.ndarray) -> Insertion:
    return replace(insertion, **columns)
