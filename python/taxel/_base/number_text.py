"""Numbers in text, as other programs write them: ASCII digits, without the underscores that Python also reads."""

from __future__ import annotations

from collections.abc import Iterable


def float_of(text: str) -> float:
    """Return the number that a text states; it may be infinite or NaN.

    Raises
    ------
    ValueError : not a number, an underscore, or digits that are not ASCII

    Examples
    --------
    >>> float_of(" 1e3 ")
    1000.0
    """
    refuse_digits([text])
    return float(text)


def int_of(text: str) -> int:
    """Return the whole number that a text states in decimal digits.

    Raises
    ------
    ValueError : not a whole number, an underscore, or digits that are not ASCII

    Examples
    --------
    >>> int_of("-12")
    -12
    """
    refuse_digits([text])
    return int(text)


def refuse_digits(texts: Iterable[str]) -> None:
    """Refuse texts that Python reads as numbers and no other program writes.

    Raises
    ------
    ValueError : an underscore, or a digit that is not ASCII (names the text)
    """
    for text in texts:
        if "_" in text or not text.strip().isascii():
            raise ValueError(f"not a number in ASCII digits: {text!r}")
