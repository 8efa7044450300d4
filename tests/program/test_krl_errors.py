"""What is refused, and what the refusal says."""

from __future__ import annotations

import pytest
from krl_samples import HEAD, read

from robotrue.errors import FormatError

P = "{X 1,Y 2,Z 3,A 4,B 5,C 6}"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "part.src:1: not a KRL program: no DEF, DEFDAT, point or motion was found. "),
        (
            b"MODULE m\n  MoveL p1,v1,z1,t;\nENDMODULE\n",
            "part.src:1: not a KRL program: it looks like an ABB RAPID",
        ),
        (b"/PROG  X\n/MN\n", "part.src:1: not a KRL program: it looks like a Fanuc LS program"),
        (b"/JOB\n//NAME X\n", "it looks like a Yaskawa JBI job"),
        (b"\n$$ a\nGOTO / 1,2,3\n", "part.src:2: not a KRL program: it looks like APT"),
        (b"N10 G1 X5\n", "it looks like ISO G-code"),
        (b"def p():\n  movel(p[0,0,0,0,0,0])\nend\n", "it looks like a UR script"),
        (b"n,x,y\n1,2,3\n", "The first statement is 'n,x,y'."),
        (b"DEF p()\nLIN {X 1.0,Y 2", "part.src:2: column 5: '{' without its '}' on the same line"),
        (b"DEF p()\nLIN {X 1.0,Y 2\n,Z 3}\n", "part.src:2: column 5: '{' without its '}'"),
        (b"DEF p()\ngs[1]={p {X 1.0,Y 2}\n", "part.src:2: column 21: '{' without its '}'"),
        (b"DEF p()\nLIN X 1}\n", "part.src:2: column 8: '}' without a '{'"),
        (b"DEF p()\nLIN {X 1.2.3,Y 2}\n", "part.src:2: column 8: an unreadable number."),
        (b"DEF p()\nLIN {X 1E999,Y 2}\n", "part.src:2: column 8: an unreadable number."),
        (b"DEF p()\nLIN {X 1,x 2}\n", "part.src:2: column 12: a component that occurs twice"),
        (b"DEF p()\nPTP {X 1,S 'B012'}\n", "part.src:2: column 12: a based integer"),
        (b"DEF p()\n\0\n", "part.src:2: NUL byte at offset 8"),
        (b"\xff\xfeD\0E\0F\0", "part.src:1: the file is UTF-16"),
    ],
)
def test_refusals(data: bytes, message: str) -> None:
    with pytest.raises(FormatError) as caught:
        read(data)
    assert message in str(caught.value)
    assert caught.value.hint


def test_the_whole_text_of_one() -> None:
    with pytest.raises(FormatError) as caught:
        read(HEAD + "LIN {X 1.0,Y 2\nEND\n")
    assert str(caught.value) == (
        "part.src:4: column 5: '{' without its '}' on the same line: the aggregate is cut off. "
        "The line is 'LIN {X 1.0,Y 2'. Try: KRL keeps a statement on one line; export the program "
        "again, or close the brace."
    )


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
def test_line_numbers_with_every_line_end(end: bytes) -> None:
    data = end.join([b"\xef\xbb\xbf&ACCESS RVP", b"DEF p()", b"; \xe4\xb0", f"LIN {P}".encode()])
    assert read(data).line.tolist() == [4]


def test_a_program_without_targets_and_a_bare_list_of_motions() -> None:
    assert len(read("DEF p()\nEND\n")) == 0
    assert len(read(f"LIN {P}\nLIN {P}")) == 2


def test_camrob_is_named() -> None:
    program = read('DEF p()\nCR_PROCESS_FILE("x.csv",1,-1,"OK")\nEND\n')
    said = "part.src:2: the targets are in x.csv, which is not next to the program."
    assert program.notes == (said,)
