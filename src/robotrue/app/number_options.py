"""Options that hold several numbers as one text, with commas between."""

from __future__ import annotations

from robotrue.core.arrays import Array, parse_number_list
from robotrue.errors import ConfigurationError


def parse_numbers(
    option: str, text: str, wanted: int | None = None, *, form: str = "", hint: str = ""
) -> Array:
    """Returns the numbers of an option.

    Args:
        option: As the user spells it.
        text: Its value.
        wanted: How many; None for any number.
        form: What they mean, as ``A,B,C``.
        hint: One thing to try; empty: the form, or as many zeros.

    Raises:
        ConfigurationError: Another count, or not finite.
    """
    values = parse_number_list(text)
    if values.size != (wanted or values.size or 1):
        numbers = "numbers" if wanted is None else f"{wanted} numbers"
        example = form or ",".join(["0"] * (wanted or 2))
        raise ConfigurationError(
            f"{option} {text!r}, expected {numbers}"
            + (f": {form}." if form else " with commas between."),
            hint=hint or f"{option} {example}",
        )
    return values
