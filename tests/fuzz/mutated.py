"""Damage: what transfer, editors, other languages and bad luck do to a program."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

NUMBER = re.compile(rb"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?")
TOKEN = re.compile(rb"[A-Za-z_$#][\w$]*|[+-]?\d+\.?\d*|[^\sA-Za-z0-9_]")
NUMBERS = (
    b"1E999", b"-1E999", b"1E-400", b"9" * 400, b"0." + b"9" * 400, b"-", b"+", b".", b"-.",
    b"1.2.3", b"1e", b"1E+", b"nan", b"inf", b"0x1F", b"1_000", b"1,5", b"--1", b"+-1",
    b"00000000000000001", b"99999999999999999999", b"-2147483649", b"1E308", b"1E9",
    b"-0.0", b"\xd9\xa1\xd9\xa2", b"1" * 5000,
)  # fmt: skip
PAIRS = ((b"(", b")"), (b"[", b"]"), (b"{", b"}"), (b"IF x\n", b"ENDIF\n"), (b'"', b'"'))
Damage = Callable[[np.random.Generator, bytes, Sequence[bytes], bytes], bytes]


def damaged(rng: np.random.Generator, data: bytes, pieces: Sequence[bytes], other: bytes) -> bytes:
    """The data after one to four kinds of damage.

    Args:
        rng: Decides.
        data: Of a program.
        pieces: Of the language.
        other: Another program, to splice in.
    """
    for _ in range(int(rng.choice([1, 1, 1, 2, 2, 3, 4]))):
        data = KINDS[int(rng.integers(len(KINDS)))](rng, data, pieces, other)
    return data[:MOST]


MOST = 60_000
"""Bytes; what is longer is cut off, which is damage, too."""


def _at(rng: np.random.Generator, data: bytes) -> int:
    return int(rng.integers(len(data) + 1))


def _span(rng: np.random.Generator, data: bytes, most: int) -> tuple[int, int]:
    begin = _at(rng, data)
    return begin, min(begin + int(rng.integers(1, most + 1)), len(data))


def _flip(rng, data, pieces, other):
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        if out:
            out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def _any_bytes(rng, data, pieces, other):
    begin, end = _span(rng, data, 4)
    return data[:begin] + rng.bytes(int(rng.integers(0, 5))) + data[end:]


def _delete(rng, data, pieces, other):
    begin, end = _span(rng, data, int(rng.choice([1, 5, 40, 400])))
    return data[:begin] + data[end:]


def _truncate(rng, data, pieces, other):
    return data[: _at(rng, data)]


def _double(rng, data, pieces, other):
    begin, end = _span(rng, data, int(rng.choice([3, 60, 600])))
    to = _at(rng, data)
    return data[:to] + data[begin:end] * int(rng.choice([1, 1, 2, 5])) + data[to:]


def _lines(rng, data, pieces, other):
    rows = data.split(b"\n")
    a, b = int(rng.integers(len(rows))), int(rng.integers(len(rows)))
    kind = int(rng.integers(4))
    if kind == 0:
        rows[a], rows[b] = rows[b], rows[a]
    elif kind == 1:
        rows.insert(a, rows[b])
    elif kind == 2:
        del rows[a]
    else:
        rows[a : a + 2] = [b"".join(rows[a : a + 2])]
    return b"\n".join(rows)


def _swap(rng, data, pieces, other):
    found = list(TOKEN.finditer(data))
    if len(found) < 2:
        return data
    i, j = sorted(int(k) for k in rng.choice(len(found), 2, replace=False))
    one, two = found[i], found[j]
    return (data[: one.start()] + two[0] + data[one.end() : two.start()] + one[0]
            + data[two.end() :])  # fmt: skip


def _number(rng, data, pieces, other):
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    one = found[int(rng.integers(len(found)))]
    return data[: one.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + data[one.end() :]


def _piece(rng, data, pieces, other):
    at, cut = _at(rng, data), int(rng.integers(0, 9))
    return data[:at] + pieces[int(rng.integers(len(pieces)))] + data[at + cut :]


def _nest(rng, data, pieces, other):
    opened, closed = PAIRS[int(rng.integers(len(PAIRS)))]
    depth, at = int(rng.choice([2, 30, 400, 3000])), _at(rng, data)
    inner = opened * depth + (closed * depth if rng.random() < 0.7 else b"")
    return data[:at] + inner + data[at:]


def _repeat(rng, data, pieces, other):
    at, piece = _at(rng, data), pieces[int(rng.integers(len(pieces)))]
    return data[:at] + piece * int(rng.choice([10, 100, 1500])) + data[at:]


def _encode(rng, data, pieces, other):
    text = data.decode("latin-1")
    kind = int(rng.integers(7))
    if kind < 2:
        return text.encode(("utf-16", "utf-16-le")[kind])
    if kind == 2:
        return text.encode("utf-8")
    if kind == 3:
        return b"\xef\xbb\xbf" * int(rng.integers(1, 3)) + data
    if kind == 4:
        return data.replace(b"\n", b"\r" if rng.random() < 0.5 else b"\r\r\n")
    if kind == 5:
        return data.replace(b" ", b"\xa0" if rng.random() < 0.5 else b"\x0b")
    return data.replace(b".", b",")


def _splice(rng, data, pieces, other):
    begin, end = _span(rng, other, 400)
    at = _at(rng, data)
    return data[:at] + other[begin:end] + data[at:]


def _case(rng, data, pieces, other):
    begin, end = _span(rng, data, 80)
    return data[:begin] + data[begin:end].swapcase() + data[end:]


KINDS: Sequence[Damage] = (
    _flip, _any_bytes, _delete, _truncate, _double, _lines, _lines, _swap, _swap, _number, _number,
    _piece, _piece, _piece, _nest, _repeat, _encode, _splice, _case,
)  # fmt: skip
