"""Targets of Fanuc moves that registers move or hold: what is followed, and how it is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fanuc_samples import TABLE, body, read, record, shifted, text

from robotrue.core.arrays import Array
from robotrue.core.units import MM
from robotrue.program.formats import read_job
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program, Reason

FRAMES = "UFRAME_NUM=1 ;\nUTOOL_NUM=1 ;\n"
CLEAR = FRAMES + "PR[1]=LPOS-LPOS ;\n"
POSREG = (
    "[*POSREG*]$POSREG  Storage: SHADOW  Access: RW  : ARRAY[1,100] OF Position Reg\r\n"
    "    [1,1] =   'lift' \r\n  Group: 1   Config: N U T, 0, 0, 0\r\n"
    "  X:     0.000   Y:     0.000   Z:    50.000\r\n"
    "  W:     0.000   P:     0.000   R:     0.000\r\n"
    "    [1,2] =   '' Uninitialized\r\n    [1,3] =   'home'   Group: 1\r\n"
    "  J1 =    60.000 deg   J2 =   -50.000 deg   J3 =    10.000 deg \r\n"
    "  J4 =   -10.000 deg   J5 =   -95.000 deg   J6 =   -50.000 deg \r\n\r\n"
    "    [1,4] =   'rest' \r\n  Group: 1   Config: N U T, 0, 0, 0\r\n"
    "  X:   700.000   Y:      .500   Z:   400.000\r\n"
    "  W:   180.000   P:     0.000   R:    15.000\r\n"
)


def places(program: Program) -> Array:
    """Where the moves lead (k, 3), mm in base; NaN where a target is not known."""
    out = np.full((len(program.path), 3), np.nan)
    for k, row in enumerate(program.path[:, 1].tolist()):
        if row >= 0 and program.reason[row] == Reason.NONE:
            frame = program.T_base_frame[program.frame[row]]
            out[k] = (frame[:3, :3] @ program.position[row] + frame[:3, 3]) / MM
    return out


def rewritten(program: Program) -> str:
    """The program with every target that is known 1 mm further along x."""
    after = find_language("fanuc_ls").write(program, shifted(program, (1.0, 0.0, 0.0)))
    assert find_language("fanuc_ls").write(program, shifted(program)) == program.data
    return after.decode("latin-1")


@pytest.mark.parametrize(
    ("statements", "z"),
    [
        ("PR[1,3]=50 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", [498.75]),
        ("PR[1,3]=(-50) ;\nL P[1] 9mm/sec FINE Offset,PR[1:lift] ;", [398.75]),
        ("R[4]=25 ;\nPR[1,3]=R[4]*2 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", [498.75]),
        ("PR[1,3]=50 ;\nPR[2]=PR[1]+PR[1] ;\nL P[1] 9mm/sec FINE Offset,PR[2] ;", [548.75]),
        ("PR[1,3]=50 ;\nOFFSET CONDITION PR[1] ;\nL P[1] 9mm/sec FINE Offset ;", [498.75]),
        ("PR[1,3]=9 ;\nOFFSET CONDITION PR[1],UFRAME[1] ;\nL P[1] 9mm/sec FINE Offset ;", [457.75]),
        ("PR[1,3]=50 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;\nL P[1] 9mm/sec FINE ;",
         [498.75, 448.75]),
        ("PR[2]=P[1] ;\nPR[2,3]=PR[2,3]+80 ;\nJ PR[2] 5% FINE ;\nL P[1] 9mm/sec FINE ;",
         [528.75, 448.75]),
        ("PR[1,3]=50 ;\nFOR R[1]=1 TO 3 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;\nENDFOR ;", [498.75]),
        ("IF DI[1]=ON,JMP LBL[1] ;\nPR[1,3]=0 ;\nLBL[1] ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;",
         [448.75]),
        ("PR[1,3]=40 ;\nIF (DI[1]=ON) THEN ;\nPR[1,3]=50 ;\nELSE ;\nPR[1,3]=R[3] ;\nPR[1,3]=50 ;\n"
         "ENDIF ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", []),
    ],
)  # fmt: skip
def test_offsets_and_registers_of_constants(statements: str, z: list[float]) -> None:
    program = body(record(1), CLEAR + statements)
    before = places(program)
    if not z:  # a register that one way does not know
        assert np.isnan(before).all()
        return
    np.testing.assert_allclose(before[:, 2], z, atol=1e-9)
    after = places(read(rewritten(program)))
    np.testing.assert_allclose(after, before + np.array([1.0, 0.0, 0.0]), atol=1e-6)


@pytest.mark.parametrize(
    ("statements", "why"),
    [
        ("PR[1,6]=90 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", "PR[1] rotates the target"),
        ("PR[1,3]=R[7] ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", "the value of PR[1] there"),
        ("IF DI[1]=ON,JMP LBL[1] ;\nPR[1,3]=5 ;\nLBL[1] ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;",
         "the value of PR[1] there"),
        ("PR[1,3]=5 ;\nCALL VISION ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", "the value of PR[1]"),
        ("RUN VISION ;\nPR[1,3]=5 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", "the value of PR[1]"),
        ("PR[R[2]]=LPOS ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;", "the value of PR[1] there"),
        ("FOR R[1]=1 TO 3 ;\nPR[1,3]=PR[1,3]+5 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;\nENDFOR ;",
         "the value of PR[1] there"),
        ("OFFSET CONDITION PR[1] ;\nPR[1,3]=5 ;\nL P[1] 9mm/sec FINE Offset ;",
         "differs between its condition"),
        ("OFFSET CONDITION PR[1],UFRAME[2] ;\nL P[1] 9mm/sec FINE Offset ;", "names frame 2"),
        ("L P[1] 9mm/sec FINE Skip,LBL[1],PR[1]=LPOS ;\nLBL[1] ;\n"
         "L P[1] 9mm/sec FINE Offset,PR[1] ;", "the value of PR[1] there"),
        ("PR[2]=LPOS ;\nL PR[2] 9mm/sec FINE ;", "the value of PR[2] there"),
        ("L PR[1] 9mm/sec FINE ;", "the CONFIG of PR[1] is unknown"),
        ("PR[2]=P[1] ;\nUFRAME_NUM=R[9] ;\nL PR[2] 9mm/sec FINE ;", "frames in force"),
    ],
)  # fmt: skip
def test_what_is_not_known_is_left_alone_and_why(statements: str, why: str) -> None:
    program = body(record(1), CLEAR + statements)
    last = int(program.path[-1, 1])
    assert last < 0 or program.reason[last] == Reason.EXPRESSION
    assert any(why in note and note.startswith("test.ls:") for note in program.notes)
    after = read(rewritten(program))
    assert after.position[0] == pytest.approx(program.position[0])


def test_an_offset_in_the_tool() -> None:
    program = body(record(1), CLEAR + "PR[1,3]=50 ;\nL P[1] 9mm/sec FINE Tool_Offset,PR[1] ;")
    assert program.reason.tolist() == [Reason.NONE]
    assert program.T_flange_tool[program.tool[0]][2, 3] == pytest.approx(0.05)


def test_the_record_of_moves_of_two_kinds_serves_the_plain_one() -> None:
    statements = "PR[1,3]=50 ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;\nL P[1:pick] 9mm/sec FINE ;"
    program = body(record(1), CLEAR + statements)
    lines = rewritten(program).split("\n")
    assert "   5:L P[2] 9mm/sec FINE Offset,PR[1] ;" in lines
    assert "   6:L P[1:pick] 9mm/sec FINE ;" in lines
    assert lines.index("P[2]{") > lines.index("P[1]{")
    assert lines[-2] == "/END"


def test_the_move_that_is_left_alone_keeps_its_place_when_its_record_is_changed() -> None:
    statements = "PR[1,3]=50 ;\nL P[1] 9mm/sec FINE ;\nL P[1] 9mm/sec FINE Offset,PR[1] ;"
    program = body(record(1), CLEAR + statements)
    change = shifted(program, (1.0, 0.0, 0.0))
    only = np.array(change.changed)
    only[1] = False
    data = find_language("fanuc_ls").write(
        program,
        type(change)(changed=only, position=change.position, rotation=change.rotation,
                     axes=change.axes, words=change.words),
    )  # fmt: skip
    np.testing.assert_allclose(places(read(data)) - places(program), [[1, 0, 0], [0, 0, 0]],
                               atol=1e-6)  # fmt: skip


def write_job(folder: Path, **files: str) -> None:
    for name, content in files.items():
        (folder / name.replace("_", ".")).write_bytes(content.encode())


@pytest.mark.parametrize(
    ("other", "known"), [("DO[1]=ON ;", True), ("PR[4]=LPOS ;", False), ("CALL VISION ;", False)]
)
def test_registers_of_a_file_that_nothing_sets(tmp_path: Path, other: str, known: bool) -> None:
    statements = FRAMES + "L PR[4:rest] 9mm/sec FINE ;\nL P[1] 9mm/sec FINE ;\nJ PR[3] 5% FINE ;"
    main = text(record(1), statements).replace("/PROG  TEST", "/PROG  MAIN")
    write_job(tmp_path, MAIN_LS=main, SUB_LS=text(record(1), other), POSREG_VA=POSREG)
    program = read_job(tmp_path, TABLE)[0]
    found = places(program)
    assert np.isfinite(found[:, 0]).tolist() == [known, True, False]
    if known:
        np.testing.assert_allclose(found[0], [700, 0.5, 400])
        assert any("POSREG.VA has them" in note for note in program.notes)
        after = rewritten(program)
        assert "L P[2] 9mm/sec FINE" in after
        assert "UF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0'" in after
        np.testing.assert_allclose(places(read(after))[0], [701, 0.5, 400], atol=1e-6)


def test_programs_with_other_groups_keep_their_registers() -> None:
    program = text(record(1), CLEAR + "PR[2]=P[1] ;\nL PR[2] 9mm/sec FINE ;")
    assert len(read(program)) == 2
    assert len(read(program.replace("= 1,*,*,*,*", "= 1,1,*,*,*"))) == 1


def test_frames_of_programs_without_a_cell_are_told() -> None:
    program = body(record(1), CLEAR + "PR[2]=P[1] ;\nL PR[2] 9mm/sec FINE ;", FrameTable())
    assert program.reason[1] == Reason.UNKNOWN_FRAME
