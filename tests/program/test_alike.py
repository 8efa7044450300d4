"""Records and moves that are alike are read at once, as one by one."""

from __future__ import annotations

import re
from dataclasses import fields

import fanuc_samples
import jbi_samples
import numpy as np
import pytest

from robotrue.errors import FormatError
from robotrue.program.formats.alike import Alike
from robotrue.program.lang import find_language

NUMBERS = ["5", "-12.5", "+3.25", ".5", "7.", "1e1", "2.5E-1", "********", "1" * 16 + ".0", "12 3"]
REFUSED = "refused: "
ENDS = ["\n", "\n", "\n", "\r\n", "\r", "\n\n"]


class Writer:
    """Programs whose points and moves are nearly alike."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.odd = self.rng.choice([0.0, 0.01, 0.1])
        self.end = ENDS[self.rng.integers(3, 5)] if self.rng.random() < 0.5 else "\n"

    def pick(self, usual: str, *others: str) -> str:
        return str(self.rng.choice(others)) if self.rng.random() < self.odd else usual

    def number(self) -> str:
        usual = f"{self.rng.normal() * 10.0 ** self.rng.integers(0, 4):.{self.rng.integers(1, 5)}f}"
        return self.pick(usual, *NUMBERS)

    def line_end(self) -> str:
        return self.pick(self.end, *ENDS)

    def fanuc(self) -> bytes:
        count = int(self.rng.integers(2, 40))
        moves, points = "", ""
        for k in range(1, count + 1):
            gap = " " * int(self.rng.integers(1, 4))
            tail = self.pick("100mm/sec CNT100", "5% FINE", "2mm/sec FINE INC", "100mm/sec Offset")
            number = self.pick(str(k), "0012", f'{k}:"a {k}"', "R[1]", "1234567")
            moves += f"{k:4d}:{self.pick('L', 'J', 'S', 'A')}{gap}P[{number}]{gap}{tail} ;"
            moves += self.pick(self.line_end(), "", " ! x ;\n", "UFRAME_NUM=1 ;\n")
            name = self.pick("", ':"b"', f':"b{k}"')
            frame, config = (
                self.pick("1", "2", "F"),
                self.pick("N U T, 0, 0, 0", "F U T, 0, 0, 1", "?"),
            )
            values = [f"{n} ={gap}{self.number()}{gap}{u}" for n, u in
                      zip("XYZWPR", ["mm"] * 3 + ["deg"] * 3, strict=True)]  # fmt: skip
            points += f"P[{k}{name}]{{{self.end}   GP1:{gap}UF : {frame}, UT : 1,"
            points += self.pick(f" CONFIG : '{config}',", "") + self.end + ",\t".join(values)
            points += self.pick("", ",\tE1 = 5.0 mm", ",\tE1 = 0.0 mm") + self.end + "};"
            points += self.line_end()
        return f"/PROG A\n/MN\n{moves}/POS\n{points}/END\n".encode()

    def jbi(self) -> bytes:
        count, points, moves = int(self.rng.integers(2, 40)), jbi_samples.HEAD, ""
        always = self.rng.random() < 0.5
        for k in range(count):
            if always or self.rng.random() < self.odd:
                points += self.pick("///RCONF 1,0,0,0,0,0,0,0", "///RCONF 0,0,0,0,0,0,1", "'x 1")
                points += self.line_end()
            values = self.pick(",", " ,", ", ").join(self.number() for _ in range(6))
            name = f"{self.pick('C', 'P')}{k:05d}"
            points += f"{name}={values}{self.line_end()}"
            points += self.pick("", "BC00001=1.0\n", "///USER 2\n///POSTYPE USER\n")
            moves += f"MOV{self.pick('L', 'J', 'C', 'S')} {name} "
            moves += self.pick("V=20.0", "VJ=5.0 'C00001", "V=20.0 +MOVJ C00001", "VJ=2.0 FPT")
            moves += self.line_end() + self.pick("", "SFTON P001\n", "SFTOF\n", "SET P002 P001\n")
        head = "/JOB\n//NAME A\n//POS\n///NPOS 3,0,0,0,0,0\n"
        return f"{head}{points}//INST\nNOP\n{moves}END\n".encode()


def content(dialect: str, data: bytes) -> str:
    samples = {"fanuc_ls": fanuc_samples, "jbi": jbi_samples}[dialect]
    try:
        program = find_language(dialect).read(data, name="part", frames=samples.TABLE)
    except FormatError as cause:
        return f"{REFUSED}{cause}"
    tokens, scan = program.spans.tokens, program.spans.scan
    columns = [getattr(program, field.name) for field in fields(program) if field.name != "spans"]
    columns += [tokens.start, tokens.length, tokens.value, tokens.kind]
    columns += [getattr(scan, name) for name in ("config", "configuration") if hasattr(scan, name)]
    return repr([each.tolist() if isinstance(each, np.ndarray) else each for each in columns])


@pytest.mark.parametrize("dialect", ["fanuc_ls", "jbi"])
def test_alike_texts_are_read_as_one_by_one(dialect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    read = 0
    for seed in range(200):
        writer = Writer(seed)
        data = writer.jbi() if dialect == "jbi" else writer.fanuc()
        at_once = content(dialect, data)
        with monkeypatch.context() as patch:
            patch.setattr(Alike, "after", lambda *_: iter(()))
            assert content(dialect, data) == at_once, (seed, data)
        read += not at_once.startswith(REFUSED)
    assert read > 80


def test_a_block_of_many_alike_texts() -> None:
    data = b"".join(b"P%d=%d.5;" % (k, 2 * k) for k in range(9000))
    pattern = re.compile(rb"P(\d+)=([\d.]+);")
    match = pattern.match(data)
    assert match
    found = np.concatenate(list(Alike(data, wholes=(1,), zones=(2,)).after(match, len(data))))
    assert found[:, 2].tolist() == list(range(1, 9000))
    assert [data[a:b] for a, b in found[-1:, 4:6].tolist()] == [b"17998.5"]
    assert found[1:, 0].tolist() == found[:-1, 1].tolist()
    assert found[-1, 1] == len(data)
