"""What is said of a damaged or hostile trajectory: always one clear line."""

from __future__ import annotations

from conevo.errors import UsageError

__all__ = ["DAMAGE", "DAMAGED", "one_line", "refusal"]

# What damaged numbers and names make their readers raise.
DAMAGE = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
DAMAGED = "the trajectory is damaged: "


def refusal(error: Exception) -> UsageError:
    """Return the error for a damaged trajectory: one line that says what was wrong."""
    return UsageError(DAMAGED + one_line(str(error) or type(error).__name__))


def one_line(text: str) -> str:
    """Return the beginning of a text that a damaged file may have a part in, as one clear line."""
    return "".join(c if c.isprintable() else " " for c in text[:200])
