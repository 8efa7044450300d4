"""Compiled reading of KRL words, numbers and aggregates at one place of the bytes."""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array, Bytes, Integers
from robotrue.core.compiled import PLAIN, compile_kernel

_POW10: Final = np.array([10.0**k for k in range(23)])


@compile_kernel(PLAIN)
def blank(buf: Bytes, i: int, end: int) -> int:
    """Returns the first place from ``i`` that is not a blank or tab."""
    while i < end and (buf[i] == 32 or buf[i] == 9):
        i += 1
    return i


@compile_kernel(PLAIN)
def word(buf: Bytes, i: int, end: int) -> tuple[int, int]:
    """Returns (key, end) of the word at ``i``; key 0 if none, -1 if longer than ten letters."""
    key, j = 0, i
    while j < end:
        c = buf[j]
        if 97 <= c <= 122:
            c = c - 32
        if not (65 <= c <= 90 or 48 <= c <= 57 or c == 95):
            break
        key = key * 64 + c - 32
        j += 1
    if j - i > 10:
        key = -1
    return key, j


@compile_kernel(PLAIN)
def find(keys: Integers, key: int) -> int:
    """Returns the place of a key, -1 if it is missing."""
    for k in range(keys.size):
        if keys[k] == key:
            return k
    return -1


@compile_kernel(PLAIN)
def read_number(buf: Bytes, i: int, end: int) -> tuple[float, int]:
    """Returns (value, end) of ``[+-]?digits[.digits][ E[+-]digits]`` at ``i``; end = i if none."""
    j, negative = i, False
    if j < end and (buf[j] == 43 or buf[j] == 45):
        negative = buf[j] == 45
        j += 1
    mantissa, kept, digits, power = 0, 0, 0, 0
    point = False
    while j < end:
        c = buf[j]
        if 48 <= c <= 57:
            digits += 1
            if kept < 18:
                mantissa = mantissa * 10 + (c - 48)
                kept += mantissa > 0
                power -= point
            else:
                power += not point
        elif c == 46 and not point:
            point = True
        else:
            break
        j += 1
    if digits == 0:
        return 0.0, i
    k = blank(buf, j, end)
    if k < end and (buf[k] == 69 or buf[k] == 101):
        k += 1
        down = False
        if k < end and (buf[k] == 43 or buf[k] == 45):
            down = buf[k] == 45
            k += 1
        exponent, first = 0, k
        while k < end and 48 <= buf[k] <= 57:
            exponent = min(exponent * 10 + (buf[k] - 48), 9999)
            k += 1
        if k > first:
            j = k
            power += -exponent if down else exponent
    value = float(mantissa)
    if -22 <= power < 0:
        value /= _POW10[-power]
    elif 0 <= power <= 22:
        value *= _POW10[power]
    else:
        value *= 10.0**power
    return (-value if negative else value), j


@compile_kernel(PLAIN)
def _read_based(buf: Bytes, i: int, end: int) -> tuple[float, int]:
    """Returns (value, end) of ``'B0110'``, ``'B 110'`` or ``'H1F'`` at ``i``; else end = i."""
    if i + 3 >= end:
        return 0.0, i
    letter = buf[i + 1] & 223
    if letter != 66 and letter != 72:
        return 0.0, i
    value, base, first = 0, (2 if letter == 66 else 16), blank(buf, i + 2, end)
    j = first
    while j < end and buf[j] != 39:
        c = buf[j]
        digit = 99
        if 48 <= c <= 57:
            digit = c - 48
        elif 65 <= (c & 223) <= 70:
            digit = (c & 223) - 55
        if digit >= base or value >= 2**40:
            return 0.0, i
        value = value * base + digit
        j += 1
    if j >= end or j == first:
        return 0.0, i
    return float(value), j + 1


@compile_kernel(PLAIN)
def _skip_value(buf: Bytes, i: int, end: int) -> int:
    """Returns the ``,`` or ``}`` that ends an expression at ``i``, or ``end``."""
    depth = 0
    while i < end:
        c = buf[i]
        if c == 40 or c == 91 or c == 123:
            depth += 1
        elif depth > 0 and (c == 41 or c == 93 or c == 125):
            depth -= 1
        elif depth == 0 and (c == 44 or c == 125):
            return i
        i += 1
    return end


@compile_kernel(PLAIN)
def aggregate(
    buf: Bytes,
    i: int,
    end: int,
    type_keys: Integers,
    component_keys: Integers,
    n_tok: int,
    tok_component: Integers,
    tok_start: Integers,
    tok_length: Integers,
    tok_value: Array,
) -> tuple[int, int, int, int, int]:
    """Reads the braces opening at ``i``.

    Returns (closing brace or -1 if it is no aggregate of components, tokens, flag, error, place).
    """
    j = blank(buf, i + 1, end)
    key, k = word(buf, j, end)
    after = blank(buf, k, end)
    if after < end and buf[after] == 58:
        if find(type_keys, key) < 0:
            return -1, n_tok, 0, 0, 0
        j = after + 1
    flag, seen = 0, 0
    while True:
        j = blank(buf, j, end)
        key, k = word(buf, j, end)
        code = find(component_keys, key)
        if code < 0:
            return -1, n_tok, 0, 0, 0
        j = blank(buf, k, end)
        if j < end and buf[j] == 123:
            return -1, n_tok, 0, 0, 0
        if seen & (1 << code):
            return -1, n_tok, 0, 4, j
        seen |= 1 << code
        start = j
        if j < end and buf[j] == 39:
            value, j = _read_based(buf, j, end)
            if j == start:
                return -1, n_tok, 0, 5, j
        else:
            value, j = read_number(buf, j, end)
        if not np.isfinite(value):
            return -1, n_tok, 0, 3, start
        after = blank(buf, j, end)
        plain = j > start and after < end and (buf[after] == 44 or buf[after] == 125)
        if plain:
            tok_component[n_tok] = code
            tok_start[n_tok] = start
            tok_length[n_tok] = j - start
            tok_value[n_tok] = value
            n_tok += 1
        else:
            if j > start and j < end and (buf[j] == 46 or 48 <= buf[j] <= 57):
                return -1, n_tok, 0, 3, start
            flag = 1
            after = _skip_value(buf, j, end)
            if after >= end:
                return -1, n_tok, 0, 1, i
        if buf[after] == 125:
            return after, n_tok, flag, 0, 0
        j = after + 1
