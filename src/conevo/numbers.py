"""Numbers, time spans and spreads as people read them, the same in every command and page."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = ["decimals", "duration", "enumerated", "finite", "number", "plus_minus", "short"]


def number(value: float | None, digits: int | None = None, nothing: str = "-") -> str:
    """Return a number with separated thousands and four significant digits: "1,234", "0.1235".

    Args:
        value: to be shown.
        digits: decimals, in place of four significant digits.
        nothing: shown for None, NaN and infinity.
    """
    if value is None or not math.isfinite(value):
        return nothing
    if isinstance(value, int):
        return f"{value:,}"
    if digits is None:
        return f"{value:,.0f}" if 1000 <= abs(value) < 1e7 else f"{value:.4g}"
    text = f"{value:,.{digits}f}"
    return text.removeprefix("-") if not text.strip("-0.,") else text


def finite(value: float) -> float | None:
    """Return a number as JSON has it: None if it is NaN or infinite."""
    return float(value) if math.isfinite(value) else None


def decimals(value: float) -> int:
    """Return the decimals that leave about four digits of a number, for columns of numbers."""
    size = abs(value)
    return 0 if size >= 1000 or size == 0 else 1 if size >= 100 else 2 if size >= 1 else 3


def plus_minus(value: float | None, error: float | None, sign: str = "±") -> str:
    """Return a value with its error, rounded to two digits of the error: "0.055 ± 0.012".

    It has two to five decimals. Without an error, or with one of 0, the value alone has four.
    """
    if value is None or not error:
        return number(value, 4)
    digits = min(max(2, 1 - math.floor(math.log10(error))), 5)
    return f"{value:.{digits}f} {sign} {error:.{digits}f}"


def short(value: float) -> str:
    """Return 20000 as 20k, which is short enough for the axes of small panels."""
    for size, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if abs(value) >= size:
            return f"{value / size:.3g}{letter}"
    return f"{value:.3g}"


def duration(seconds: float) -> str:
    """Return a time span: "42 s", "4 min 05 s", "3 h 20 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


def enumerated(name: str, robots: Sequence[int]) -> str:
    """Return robots by their numbers: "rover 3", "rovers 3 and 7"."""
    words = [str(i) for i in robots]
    listed = [", ".join(words[:-1]), words[-1]] if len(words) > 1 else words
    return f"{name}{'s' * (len(words) != 1)} {' and '.join(listed)}"
