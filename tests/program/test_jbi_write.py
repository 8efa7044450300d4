"""What is rewritten in Yaskawa jobs, how, and what never is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from jbi_samples import HEAD, TABLE, P, body, read, shifted, text, written
from krl_samples import body as krl_body

from robotrue.core.arm_words import NO_WORD
from robotrue.core.rotations import matrix_from_abc
from robotrue.core.units import DEG
from robotrue.errors import ShapeError
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable


def changed(program, change) -> list[str]:
    before = program.data.decode("latin-1").splitlines()
    after = written(program, change)
    assert len(before) == len(after)
    return [new for old, new in zip(before, after, strict=True) if old != new]


def test_only_the_numbers_of_used_points_change() -> None:
    points = f"{HEAD}C00000={P}\nC00001={P}\nBC00000=800.000"
    program = body(points, "MOVL C00000 V=800.000")
    moved = shifted(program, (0.0312, 0.0, -0.0001))
    assert changed(program, moved) == ["C00000=800.031,-100.000,448.750,180.0000,-0.0000,15.0000"]
    assert find_language("jbi").write(program, shifted(program)) == program.data


@pytest.mark.parametrize(
    ("old", "new"),
    [("5", "5.031"), ("5.0", "5.031"), ("-.5000", "-.4688"), ("+1.500", "+1.531"), ("0", "0.031")],
)
def test_the_form_of_the_number(old: str, new: str) -> None:
    program = body(f"{HEAD}C00000={old},0,0,0,0,0", "MOVL C00000")
    assert changed(program, shifted(program, (0.0312, 0, 0))) == [f"C00000={new},0,0,0,0,0"]


def test_the_triple_nearest_to_the_printed_one() -> None:
    program = body(f"{HEAD}C00000=0,0,0,170.0000,10.0000,-180.0000", "MOVL C00000")
    turn = matrix_from_abc(np.array([0.0, 0.0, 0.1 * DEG]))
    change = replace(shifted(program), rotation=program.rotation @ turn)
    assert changed(program, change) == ["C00000=0,0,0,170.1000,10.0000,-180.0000"]


@pytest.mark.parametrize("ry", ["90.0000", "-90.0000", "89.9999999"])
def test_gimbal_lock_keeps_the_split(ry: str) -> None:
    program = body(f"{HEAD}C00000=0,0,0,-12.0000,{ry},33.0000", "MOVL C00000")
    spin = matrix_from_abc(np.array([0.0, 0.0, 0.2 * DEG]))
    change = replace(shifted(program), rotation=program.rotation @ spin)
    out = find_language("jbi").write(program, change)
    assert np.abs(read(out).rotation - change.rotation).max() < 1e-3 * DEG
    rx, _, rz = (float(v) for v in out.split(b"C00000=")[1].split(b"\n")[0].split(b",")[3:])
    assert abs(rx + 12.0) < 0.21
    assert abs(rz - 33.0) < 0.21


def test_pulses_stay_whole_numbers() -> None:
    points = "///TOOL 1\n///POSTYPE PULSE\n///PULSE\nC00000=1000,-2000,3000,0,500,-7\n"
    table = FrameTable(tools=TABLE.tools, pulses_per_degree=np.array([10, 20, 30, 40, 50, -60.0]))
    program = body(points, "MOVJ C00000", table)
    np.testing.assert_allclose(program.axes[0, 5], 7 / 60 * DEG)
    all_rows = np.ones(1, dtype=bool)
    change = replace(shifted(program), changed=all_rows, axes=program.axes + 0.13 * DEG)
    assert changed(program, change) == ["C00000=1001,-1997,3004,5,506,-15"]


def test_new_words_get_a_header_of_their_own_and_the_old_ones_come_back() -> None:
    points = f"{HEAD}C00000={P}\nC00001={P}\nC00002={P}\n///RCONF 0,0,1,0,0,0,0,0\nC00003={P}"
    program = body(points, "".join(f"MOVL C{i:05d}\n" for i in range(4)))
    words = np.full_like(program.words, NO_WORD)
    words[1] = [0, NO_WORD, NO_WORD, 1, NO_WORD, NO_WORD]
    words[3, 2] = 0
    change = replace(shifted(program), words=words)
    out = find_language("jbi").write(program, change)
    assert out.decode().splitlines()[7:16] == [
        "///RCONF 1,0,0,0,0,0,0,0",
        f"C00000={P}",
        "///RCONF 0,0,0,1,0,0,0,0",
        f"C00001={P}",
        "///RCONF 1,0,0,0,0,0,0,0",
        f"C00002={P}",
        "///RCONF 0,0,1,0,0,0,0,0",
        "///RCONF 0,0,0,0,0,0,0,0",
        f"C00003={P}",
    ]
    again = read(out)
    expected = np.where(words == NO_WORD, program.words, words)
    np.testing.assert_array_equal(again.words, expected)
    assert not again.notes  # NPOS still counts the points
    back = np.where(words == NO_WORD, NO_WORD, program.words)
    undone = find_language("jbi").write(again, replace(shifted(again), words=back))
    np.testing.assert_array_equal(read(undone).words, program.words)
    unchanged = replace(change, changed=np.zeros(4, dtype=bool))
    assert find_language("jbi").write(program, unchanged) == program.data


def test_a_point_of_other_than_six_values_keeps_its_configuration() -> None:
    points = f"{HEAD}C00000={P}\nC00001=1.0,2.0,3.0\nC00002={P}"
    program = body(points, "MOVL C00000\nMOVL C00002")
    words = np.full_like(program.words, NO_WORD)
    words[0] = [0, 0, 0, 1, 0, 0]
    lines = written(program, replace(shifted(program), words=words))
    first = lines.index("///RCONF 0,0,0,1,0,0,0,0")
    assert lines[first + 1].startswith("C00000=")
    assert lines[first + 2 : first + 4] == ["///RCONF 1,0,0,0,0,0,0,0", "C00001=1.0,2.0,3.0"]
    assert sum(line.startswith("///RCONF") for line in lines) == 3


def test_twenty_four_fields_and_dos_line_ends_are_kept() -> None:
    fields = "1,0,0,0,0,0," + ",".join("7" * 18)
    head = HEAD.replace("1,0,0,0,0,0,0,0", fields)
    job = text(f"{head}C00000={P}", "MOVL C00000").replace("\n", "\r\n")
    program = read(job)
    words = np.full_like(program.words, NO_WORD)
    words[0, 0] = 0
    out = find_language("jbi").write(program, replace(shifted(program, (1, 0, 0)), words=words))
    extra = b"///RCONF 0" + fields[1:].encode() + b"\r\nC00000=801.000"
    assert out == program.data.replace(b"C00000=800.000", extra)


def test_what_cannot_be_written() -> None:
    program = body(f"{HEAD}C00000={P}", "MOVL C00000")
    with pytest.raises(ShapeError, match=r"test\.jbi:9: the new target is \[nan"):
        written(program, shifted(program, (np.nan, 0, 0)))
    with pytest.raises(ShapeError, match=r"changed has shape \(2,\)"):
        written(program, shifted(program).take(np.array([0, 0])))
    other = krl_body("LIN {X 1,Y 2,Z 3,A 4,B 5,C 6}")
    with pytest.raises(ShapeError, match="was not read by the jbi dialect"):
        find_language("jbi").write(other, shifted(other))
