"""KRL jobs of several files: CAMRob, several programs, points in data files of other names."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from krl_samples import replacement

from robotrue.compensation.result import zero_correction
from robotrue.core.units import DEG, MM
from robotrue.errors import FormatError
from robotrue.program.external_axes import ExternalAxis
from robotrue.program.formats import read_job, write_program
from robotrue.program.lang.krl import LANGUAGE
from robotrue.program.program import FrameTable, Motion, Program, Reason

CAMROB = (
    "1;0.0000;0.0000;-1.2500;180.0000;-0.0000;10.0000;1;200.000;1;0;0;0;1;0.0000\r\n"
    "2;12.5000;0.3750;-1.2500;180.0000;0.2500;0.5000;2;200.000;1;0;0;0;1;0.0000\r\n"
    "3;25.0000;1.5000;-1.2500;179.5000;0.5000;1.0000;3;200.000;1;0;0;0;1;0.0000\r\n"
)
CALLER = (
    "DEF part()\n$TOOL={X 0,Y 0,Z 215.5,A 0,B 30,C 0}\n$BASE={X 800,Y -100,Z 450,A 15,B 0,C 0}\n"
    'PTP {A1 10,A2 -70,A3 100,A4 5,A5 60,A6 -20}\nCR_PROCESS_FILE("path.csv", 1, -1, "OK" )\n'
    "$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\nEND\n"
)


def made(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        stem, _, suffix = name.rpartition("_")
        (folder / f"{stem}.{suffix}").write_bytes(text.encode("latin-1"))
    return folder


def of(job: tuple[Program, ...], name: str) -> Program:
    return next(program for program in job if program.name == name)


def test_a_camrob_file_in_the_frames_of_its_call(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB)
    job = read_job(tmp_path / "part.src")
    assert [program.name for program in job] == ["part.src", "path.csv"]
    path = of(job, "path.csv")
    assert path.dialect == "krl"
    assert path.reason.tolist() == [0, 0, 0]
    assert path.motion.tolist() == [Motion.LIN] * 3
    assert path.line.tolist() == [1, 2, 3]
    np.testing.assert_allclose(path.position[1] / MM, [12.5, 0.375, -1.25])
    turn = np.arctan2(path.rotation[0, 1, 0], path.rotation[0, 0, 0]) / DEG
    assert turn == pytest.approx(10.0)  # A is the seventh number
    assert path.T_base_frame[path.frame[0]][0, 3] == pytest.approx(0.8)
    assert path.T_flange_tool[path.tool[0]][2, 3] == pytest.approx(0.2155)
    assert not any("csv" in note for program in job for note in program.notes)


def test_a_folder_with_a_camrob_file_is_one_job(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB)
    (tmp_path / "$config.dat").write_text("DEFDAT $CONFIG\nENDDAT\n")
    (tmp_path / "$machine.dat").write_text("DEFDAT $MACHINE PUBLIC\n$X[1]={A 1\nENDDAT\n")
    job = read_job(tmp_path)
    assert [program.name for program in job] == ["part.src", "path.csv"]
    assert {program.dialect for program in job} == {"krl"}


def test_a_camrob_file_is_written_number_by_number(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB)
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    assert write_program(path, zero_correction(path)) == CAMROB.encode()
    out = write_program(path, replacement(path, by_mm=(0.1, 0, -0.02), rows=[1])).decode()
    assert out == CAMROB.replace("12.5000;0.3750;-1.2500", "12.6000;0.3750;-1.2700")


def test_a_camrob_file_runs_in_parts_and_in_one_base(tmp_path: Path) -> None:
    some = CALLER.replace("1, -1", "2, 2")
    made(tmp_path, part_src=some, path_csv=CAMROB)
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    assert path.reason.tolist() == [Reason.UNUSED, 0, Reason.UNUSED]
    twice = CALLER.replace("END", 'CR_PROCESS_FILE("path.csv",3,-1)\nEND')
    made(tmp_path, part_src=twice)
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    assert path.reason.tolist() == [0, 0, Reason.UNKNOWN_FRAME]
    assert any("more than one base or tool" in note for note in path.notes)


def test_a_camrob_file_that_runs_before_and_behind_an_unknown_routine(tmp_path: Path) -> None:
    call = 'CR_PROCESS_FILE("path.csv", 2, 2)\n'
    frames = CALLER[CALLER.index("$TOOL") : CALLER.index("PTP")]
    for between in (f"Spindle_On(9)\n{call}", f"Spindle_On(9)\n{call}{frames}{call}"):
        text = CALLER.replace("$BASE={X 0,", between + "$BASE={X 0,")
        made(tmp_path, part_src=text, path_csv=CAMROB)
        path = of(read_job(tmp_path / "part.src"), "path.csv")
        assert path.reason.tolist() == [0, Reason.UNKNOWN_FRAME, 0]
        assert any("Spindle_On is in no file given" in note for note in path.notes)


def test_external_axes_of_a_camrob_file(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB.replace("1;0.0000\r", "1;850.0\r"))
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    assert (path.reason == Reason.EXTERNAL_AXIS).all()
    rail = ExternalAxis(number=1, direction=np.array([0.0, 1.0, 0.0]), carries_robot=True)
    path = of(read_job(tmp_path / "part.src", FrameTable(external=(rail,))), "path.csv")
    assert not path.reason.any()
    assert path.T_base_frame[path.frame[0]][1, 3] == pytest.approx(-0.95)


def test_a_camrob_file_that_is_not_there_or_not_one(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER)
    (alone,) = read_job(tmp_path / "part.src")
    assert any("path.csv, which is not next to" in note for note in alone.notes)
    made(tmp_path, path_csv=CAMROB + "4;1.0;2.0;x;0;0;0\n")
    with pytest.raises(FormatError, match=r"path.csv:4: '4;1.0;2.0;x;0;0;0' is no line of a CAM"):
        read_job(tmp_path / "part.src")


P = "X 800.0,Y 100.0,Z 600.0,A 10.0,B 20.0,C 170.0"
MAIN = (
    "\ufeff&ACCESS RVP\r\nDEF main()\r\n$TOOL={X 0,Y 0,Z 1,A 0,B 0,C 0}\r\n"
    "$BASE={X 5,Y 0,Z 0,A 0,B 0,C 0}\r\nLIN XP1\r\ncut(3)\r\nLIN {X 801.0}\r\nEND"
)
CUT = (
    f"DEF cut(n:IN)\nINT n\nLIN XP1\nPTP {{{P}}}\nLIN {{X 9.0}}\n"
    "FOR n=1 TO 2\nLIN gf[n].pos C_VEL\nENDFOR\n$BASE={X 6,Y 0,Z 0,A 0,B 0,C 0}\nEND\n"
)
POINTS = (
    "DEFDAT {name}\n"
    "DECL E6POS XP1={{X {x},Y 1.0,Z 2.0,A 0.0,B 90.0,C 0.0,S 2,T 3,E1 0.0}}\nENDDAT\n"
)
SHARED = (
    "DEFDAT shared PUBLIC\nSTRUC cut_t FRAME pos, REAL feed\nDECL GLOBAL cut_t gf[779]\n"
    "gf[1  ]={pos {X 1.0,Y 2.0,Z 3.0,A 0.0,B 90.0,C 0.0}, feed 3000.0}\n"
    "gf[2  ]={pos {X 4.0,Y 5.0,Z 6.0,A 0.0,B 90.0,C 0.0}, feed 3000.0}\nENDDAT\n"
)


def several(folder: Path) -> tuple[Program, ...]:
    (folder / "main.src").write_bytes(MAIN.encode("utf-8"))
    made(folder, cut_src=CUT, shared_dat=SHARED)
    for name, x in (("main", 700.0), ("cut", 750.0)):
        made(folder, **{f"{name}_dat": POINTS.format(name=name, x=x)})
    return read_job([folder / name for name in ("main.src", "cut.src", "shared.dat")])


def test_several_programs_are_one_job(tmp_path: Path) -> None:
    job = several(tmp_path)
    assert sorted(program.name for program in job) == sorted(
        ["main.src", "cut.src", "shared.dat", "main.dat", "cut.dat"]
    )
    x = {program.name: program.T_base_frame[program.frame][:, 0, 3] / MM for program in job}
    assert x["main.src"].tolist() == pytest.approx([6])  # as the call left it
    assert x["cut.src"][0] == pytest.approx(5)  # as it was called
    assert x["shared.dat"].tolist() == pytest.approx([5, 5])
    assert of(job, "cut.src").line.tolist() == [4, 5]
    assert of(job, "main.src").line.tolist() == [7]
    assert of(job, "shared.dat").reason.tolist() == [0, 0]
    assert of(job, "shared.dat").motion.tolist() == [Motion.LIN] * 2


def test_points_of_one_name_belong_to_their_own_program(tmp_path: Path) -> None:
    job = several(tmp_path)
    for name, at in (("main.dat", 700.0), ("cut.dat", 750.0)):
        points = of(job, name)
        assert points.reason.tolist() == [0]
        assert points.position[0, 0] == pytest.approx(at * MM)
        assert points.motion.tolist() == [Motion.LIN]


def test_what_leaves_components_out_inherits_within_its_file(tmp_path: Path) -> None:
    job = several(tmp_path)
    cut, main = of(job, "cut.src"), of(job, "main.src")
    np.testing.assert_allclose(cut.position[1] / MM, [9.0, 100.0, 600.0])
    assert main.reason.tolist() == [Reason.INCOMPLETE]
    assert any(note.startswith("main.src:7: 1 targets from this line") for note in main.notes)


def test_several_programs_are_written_each_for_itself(tmp_path: Path) -> None:
    for program in several(tmp_path):
        assert program.data == (tmp_path / program.name).read_bytes()
        assert write_program(program, zero_correction(program)) == program.data
        out = write_program(program, replacement(program, by_mm=(0.5, 0, 0))).decode("utf-8")
        before = program.data.decode("utf-8")
        changed = [
            (old, new)
            for old, new in zip(before.splitlines(), out.splitlines(), strict=True)
            if old != new
        ]
        assert len(changed) == int((program.reason == 0).sum())
        for old, new in changed:
            shift = [float(re.search(r"X (-?[\d.]+)", each)[1]) for each in (new, old)]  # type: ignore[index]
            assert shift[0] - shift[1] == pytest.approx(0.5)


def test_a_fault_is_named_in_its_own_file(tmp_path: Path) -> None:
    (tmp_path / "main.src").write_text("DEF main()\ncut()\nEND\n")
    (tmp_path / "cut.src").write_text("DEF cut()\n\nLIN {X 1.0,Y 2\nEND\n")
    with pytest.raises(FormatError, match=r"^cut.src:3: column 5: '\{' without its"):
        read_job(tmp_path)
    (tmp_path / "cut.src").write_text("LIN {X 1.0}\n")
    with pytest.raises(FormatError, match=r"cut.src:1: no DEF"):
        read_job(tmp_path)


def test_files_of_other_languages_and_folders_are_refused(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB)
    (tmp_path / "other.mod").write_text("MODULE m\nPROC main()\nENDPROC\nENDMODULE\n")
    with pytest.raises(FormatError, match=r"other\.mod is a program in rapid"):
        read_job([tmp_path / "part.src", tmp_path / "other.mod"])
    away = tmp_path / "away"
    away.mkdir()
    with pytest.raises(FormatError, match="no program in this folder"):
        read_job(away)
    made(away, part_src=CALLER)
    with pytest.raises(FormatError, match="2 files in 2 folders"):
        read_job([tmp_path / "part.src", away / "part.src"])


def test_a_camrob_path_begins_where_the_program_takes_the_arm(tmp_path: Path) -> None:
    made(tmp_path, part_src=CALLER, path_csv=CAMROB)
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    np.testing.assert_allclose(path.start / DEG, [10, -70, 100, 5, 60, -20])
    posed = CALLER.replace("PTP {A1 10,A2 -70,A3 100,A4 5,A5 60,A6 -20}", f"PTP {{{P}}}")
    made(tmp_path, part_src=posed)
    path = of(read_job(tmp_path / "part.src"), "path.csv")
    assert not len(path.start)
    assert any("no axis target before its call" in note for note in path.notes)


def test_the_files_a_program_names() -> None:
    names = LANGUAGE.name_files
    assert names(b'CR_process_file("a.csv",1)\nX = CR_PROCESS_FILE (\r\n "b.csv")') == (
        "a.csv",
        "b.csv",
    )
    assert names(b'LOG("it\'s" CR_PROCESS_FILE("b.csv")') == ("b.csv",)
    assert names(b'CR_PROCESS_FILE("../a.csv") CR_PROCESS_FILE("") OTHER("c.csv")') == ()
    assert names(b'LIN {X 1} CR_PROCESS_FILE("a.csv") CR_PROCESS_FILE("a.csv"') == ("a.csv",)


def test_global_points_that_are_compensated_are_told() -> None:
    src = "DEF a()\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}\n"
    src += "LIN gp\nLIN own\nLIN gf[1]\nEND\n"
    pose = "{X 1,Y 2,Z 3,A 0,B 0,C 0}"
    dat = f"DEFDAT a PUBLIC\nDECL GLOBAL FRAME gp={pose}\nDECL FRAME own={pose}\n"
    dat += f"GLOBAL DECL FRAME gf[2]\ngf[1]={pose}\nENDDAT\n"
    for text, told in ((dat, True), (dat.replace("GLOBAL ", ""), False)):
        files = [("a.src", src.encode()), ("a.dat", text.encode())]
        program = LANGUAGE.read_job(files, frames=FrameTable())[1]
        assert program.reason.tolist() == [Reason.NONE] * 3
        assert (
            any("a.dat: 2 targets are GLOBAL points (gp, gf)" in n for n in program.notes) == told
        )


SETS = "DEF set()\nBASE_DATA[1]={X 5,Y 0,Z 0,A 0,B 0,C 0}\nEND\n"
USES = "DEF use()\n$TOOL=$NULLFRAME\n$BASE=BASE_DATA[1]\nLIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\nEND\n"


@pytest.mark.parametrize(
    ("first", "second", "base"),
    [
        (SETS, USES, 5.0),
        (USES, SETS, None),  # whether it runs before is not known: one may call the other
        (USES, SETS.replace("DEF set()", "DEF set()\nuse()"), None),
        (USES, SETS.replace("[1]", "[2]"), 7.0),
        (SETS.replace("[1]", "[n]"), USES, None),
        (USES, SETS.replace("[1]={X", "[1].X=3 ;{"), None),
        # another value between the first and the use, but for a program that sets its own
        (SETS, SETS.replace("X 5", "X 6").replace("set", "two") + USES, None),
        (SETS, USES.replace("$BASE", "BASE_DATA[1]={X 6,Y 0,Z 0,A 0,B 0,C 0}\n$BASE"), 6.0),
        (
            SETS,
            USES.replace("$BASE", "BASE_DATA[1]={X 6,Y 0,Z 0,A 0,B 0,C 0}\nset()\n$BASE"),
            None,
        ),
    ],
)
def test_base_data_that_another_program_sets(first: str, second: str, base: float | None) -> None:
    frame = np.eye(4)
    frame[0, 3] = 7.0 * MM
    files = [("one.src", first.encode()), ("two.src", second.encode())]
    job = LANGUAGE.read_job(files, frames=FrameTable(bases={"1": frame}))
    used = next(program for program in job if len(program))
    if base is None:
        assert used.reason.tolist() == [Reason.UNKNOWN_FRAME]
        assert "the base data 1 is also set elsewhere" in "\n".join(used.notes)
    else:
        assert used.reason.tolist() == [Reason.NONE]
        assert used.T_base_frame[used.frame[0], 0, 3] == base * MM


def test_base_data_that_a_routine_alone_sets_again_behind_calls() -> None:
    again = "\n".join(
        f"BASE_DATA[1]={{X {x},Y 0,Z 0,A 0,B 0,C 0}}\nother()\n$BASE=BASE_DATA[1]\n"
        "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}"
        for x in (5, 6)
    )
    text = f"DEF use()\n$TOOL=$NULLFRAME\n{again}\nEND\nDEF other()\nEND\n"
    (program,) = LANGUAGE.read_job([("use.src", text.encode())], frames=FrameTable())
    assert program.reason.tolist() == [Reason.NONE] * 2
    np.testing.assert_array_equal(program.T_base_frame[program.frame, 0, 3], [5 * MM, 6 * MM])


def test_base_data_set_by_a_computed_number_leave_no_number_known() -> None:
    lines = "n=1\nBASE_DATA[n]={X 5,Y 0,Z 0,A 0,B 0,C 0}\n$BASE"
    (program,) = LANGUAGE.read_job(
        [("use.src", USES.replace("$BASE", lines).encode())],
        frames=FrameTable(bases={"1": np.eye(4)}),
    )
    assert program.reason.tolist() == [Reason.UNKNOWN_FRAME]
