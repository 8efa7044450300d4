"""Compares printed answers: words and whole numbers exactly, decimals within their last digit.

A value on a rounding boundary is printed up on one processor and down on the next, because the
order of sums in a compiled kernel depends on the width of its vectors. The identity of a model, a
digest of all its bits, is another one then. Numbers printed with all their digits, as in JSON,
agree to :data:`RELATIVE`.
"""

from __future__ import annotations

import difflib
import re
from decimal import Decimal
from typing import Final

DECIMAL: Final = re.compile(r"(?<![\w.])[-+]?\d+\.\d+(?:e[-+]?\d+)?(?![\w.]*\.\d)")
ALL_DIGITS: Final = 12
RELATIVE: Final = Decimal("1e-6")
DIGEST: Final = re.compile(r"\((?=[0-9a-f]*\d)[0-9a-f]{12}\)|\"[0-9a-f]{64}\"")


def agree_in_print(one: str, other: str) -> bool:
    """Returns whether texts are the same but for last digits of decimals and model identities."""
    one, other = DIGEST.sub("(identity)", one), DIGEST.sub("(identity)", other)
    if one == other:
        return True
    if DECIMAL.split(one) != DECIMAL.split(other):
        return False
    return all(
        _are_neighbours(Decimal(a), Decimal(b))
        for a, b in zip(DECIMAL.findall(one), DECIMAL.findall(other), strict=True)
    )


def _are_neighbours(a: Decimal, b: Decimal) -> bool:
    if min(len(a.as_tuple().digits), len(b.as_tuple().digits)) >= ALL_DIGITS:
        return abs(a - b) <= RELATIVE * max(abs(a), abs(b))
    exponent = a.as_tuple().exponent
    assert isinstance(exponent, int)
    return exponent == b.as_tuple().exponent and abs(a - b) <= Decimal(1).scaleb(exponent)


def assert_answers_agree(page: str, renewed: str) -> None:
    """Fails with the lines that differ by more than a rounding."""
    old, new = page.splitlines(), renewed.splitlines()
    if len(old) == len(new) and all(map(agree_in_print, old, new)):
        return
    raise AssertionError("\n".join(difflib.unified_diff(old, new, "page", "answers", lineterm="")))
