"""Targets left alone, one by one: file, line, reason, remedy."""

from __future__ import annotations

import numpy as np

from robotrue.compensation.status import Status, list_left_alone
from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Reason

JOB = """/JOB
//NAME TEST
//POS
///NPOS 5,0,0,0,0,0
///USER 7
///TOOL 1
///POSTYPE USER
///RECTAN
C00000=800.0,0.0,400.0,180.0,0.0,0.0
///POSTYPE BASE
C00001=800.0,0.0,400.0,180.0,0.0,0.0
C00002=810.0,0.0,400.0,180.0,0.0,0.0
C00003=820.0,0.0,400.0,180.0,0.0,0.0
C00004=820.0,2000000.0,400.0,180.0,0.0,0.0
//INST
///DATE 2026/11/21 08:11
///ATTR SC,RW,RJ
///GROUP1 RB1
NOP
MOVL C00000 V=9.0
MOVL C00001 V=9.0
MOVL C00002 V=9.0
MOVL C00004 V=9.0
END
"""


def test_every_target_that_keeps_its_numbers_has_line_reason_and_remedy() -> None:
    frames = FrameTable(tools={"1": np.eye(4)})
    program = find_language("jbi").read(JOB.encode(), name="a.jbi", frames=frames)
    assert program.reason.tolist() == [
        *(Reason.UNKNOWN_FRAME, 0, 0, Reason.UNUSED, Reason.OUT_OF_REACH)
    ]
    source, far = Status.UNCHANGED_SOURCE, Status.UNCHANGED_UNREACHABLE
    found = list_left_alone(program, np.array([source, Status.COMPENSATED, far, source, source]))
    assert [(each["file"], each["line"], each["target"]) for each in found] == [
        ("a.jbi", 9, 1),
        ("a.jbi", 12, 3),
        ("a.jbi", 14, 5),
    ]
    assert "work frame 7 is in the controller" in found[0]["reason"]
    assert "[[controller.base]]" in found[0]["remedy"]
    assert found[1]["reason"] == far.explanation
    assert found[2]["reason"] == "it is more than 1 km from the origin of its frame"
    assert all(each["remedy"] for each in found)


def test_every_reason_has_a_remedy() -> None:
    frames = FrameTable(tools={"1": np.eye(4)})
    program = find_language("jbi").read(JOB.encode(), name="a.jbi", frames=frames)
    kept = [each for each in Status if each > Status.UNCHANGED_NO_ERROR]
    for status in kept:
        found = list_left_alone(program, np.array([0, status, 0, 0, 0]))
        assert [each["remedy"] != "" for each in found] == [True]
