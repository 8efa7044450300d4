"""Numbers rewritten in the style of the original ones, and spliced into the bytes of a program.

The style of ``-0.50`` is two decimals, of ``+5.`` a plus and a bare point, of ``.5`` no digit
before the point, of ``1.5e-03`` an exponent of two digits. A number that equals the value already
keeps its bytes, so that ``-0.000`` stays ``-0.000``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Final, TypeAlias

from robotrue.errors import ShapeError

NUMBER: Final = rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
"""Regular expression of one number."""
WHOLE_NUMBER: Final = rb"[+-]?+(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?+\d++)?+"
"""The same for long patterns: it gives nothing back, so that a mismatch is found at once."""
_PLAIN: Final = re.compile(rb"-?\d+\.(\d+)")
_PARTS: Final = re.compile(rb"([+-]?)(\d*)(\.?)(\d*)(?:([eE])([+-]?)(\d+))?")
_FINE: Final = 6
"""Least decimals of a number with an exponent: the style of ``1E3`` holds no correction."""
LARGEST: Final = 1e9
Stretch: TypeAlias = tuple[int, int, bytes]
"""First byte and bytes of what is replaced, and what takes its place."""


def restyle(token: bytes, value: float, *, least: int = 0) -> bytes:
    """Returns ``value`` in the style of ``token``; the token itself where they agree.

    They agree when the value is within half of the last digit that would be printed.

    Args:
        token: One number, as :data:`NUMBER`.
        value: In the unit the token is printed in.
        least: Decimals to print at least: a shift of 0.02 mm would be lost in ``5`` or ``5.0``.

    Raises:
        ShapeError: The token is not a number, or the value is not finite or not below 1e9.
    """
    if not abs(value) < LARGEST:
        raise ShapeError(f"{value} cannot be printed, expected a finite number below 1e9.")
    plain = _PLAIN.fullmatch(token)
    if plain:  # nearly all there are
        return _format_fixed(token, value, max(len(plain[1]), least))
    sign, whole, point, fraction, letter, _, _ = parts = _parts(token)
    least = max(least, _FINE) if letter else least
    decimals = max(_last_decimal(parts), least)
    if abs(value - float(token)) <= 0.5 * 10.0**-decimals:
        return token
    if letter:
        return _with_exponent(parts, value, least)
    text = f"{abs(value):.{decimals}f}".encode()
    if decimals == 0 and point:
        text += b"."
    if not whole and fraction and text.startswith(b"0."):
        text = text[1:]
    return _sign(sign, value, text) + text


def _format_fixed(token: bytes, value: float, decimals: int) -> bytes:
    if abs(value - float(token)) <= 0.5 * 10.0**-decimals:
        return token
    text = b"%.*f" % (decimals, value)
    return text if text.strip(b"-0.") else text.lstrip(b"-")


def respell_literal(literal: bytes, values: Sequence[float], least: Sequence[int]) -> bytes:
    """Returns a literal with its first numbers rewritten in their own style.

    Args:
        literal: Text with numbers.
        values: New values of the first of them; NaN keeps one as it is written.
        least: Decimals each gets at least.

    Raises:
        ShapeError: A value that is infinite or not below 1e9.
    """
    tokens = re.finditer(WHOLE_NUMBER, literal)
    return splice_texts(
        literal,
        [
            (token.start(), len(token[0]), restyle(token[0], value, least=digits))
            for token, value, digits in zip(tokens, values, least, strict=False)
            if not math.isnan(value)
        ],
    )


def splice_texts(data: bytes, stretches: Iterable[Stretch]) -> bytes:
    """Returns the bytes with stretches replaced; those that begin at one place keep their order.

    Raises:
        ShapeError: Two stretches overlap, or one leaves the data.
    """
    pieces: list[bytes] = []
    cursor = 0
    for start, size, text in sorted(stretches, key=lambda each: each[:2]):
        if not cursor <= start <= start + size <= len(data):
            raise ShapeError(
                f"bytes {start} to {start + size} cannot be replaced, expected {cursor} to "
                f"{len(data)}."
            )
        pieces += data[cursor:start], text
        cursor = start + size
    pieces.append(data[cursor:])
    return b"".join(pieces)


def respell_word(token: bytes, word: int) -> bytes:
    """Returns a whole number in the base, and with at least the digits, of the original one.

    KRL and Sinumerik write ``'B0110'`` and ``'H1F'``.
    """
    if not token.startswith(b"'"):
        return b"%d" % word
    form = f"0{len(token) - 3}{'b' if token[1:2] in b'bB' else 'X'}"
    return token[:2] + format(word, form).encode() + b"'"


def _parts(token: bytes) -> tuple[bytes, ...]:
    match = _PARTS.fullmatch(token)
    if match is None or not (match[2] or match[4]):
        raise ShapeError(f"{token!r} is not a number.")
    return tuple(part or b"" for part in match.groups())


def _last_decimal(parts: tuple[bytes, ...]) -> int:
    """Place of the last digit shown after the point, negative before it."""
    exponent = int(parts[5] + parts[6]) if parts[6] else 0
    return len(parts[3]) - exponent


def _with_exponent(parts: tuple[bytes, ...], value: float, least: int) -> bytes:
    sign, _, _, fraction, letter, exponent_sign, digits = parts
    # The exponent is that of the value, so the mantissa needs more decimals where it is large.
    text, power = "", 0
    for _ in range(2):  # 9.99 may round to 10.0, which has another exponent
        power = int((text or f"{abs(value):.15e}").partition("e")[2])
        text = f"{abs(value):.{max(len(fraction), power + least, 0)}e}"
    mantissa, _, exponent = text.partition("e")
    power = int(exponent)
    told = b"-" if power < 0 else b"+" if exponent_sign == b"+" or len(digits) > 1 else b""
    shown = mantissa.encode() + letter + told + str(abs(power)).zfill(len(digits)).encode()
    return _sign(sign, value, shown) + shown


def _sign(sign: bytes, value: float, text: bytes) -> bytes:
    """Returns the sign to print; a number of zeros alone has no minus."""
    if value < 0 and re.search(rb"[1-9]", re.split(rb"[eE]", text)[0]):
        return b"-"
    return b"+" if sign == b"+" else b""
