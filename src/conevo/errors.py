"""The two kinds of errors, each one clear line, and the nearest right name for a wrong one."""

from __future__ import annotations

import difflib
import re
import traceback
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

__all__ = [
    "ConevoError",
    "EnvironmentFailure",
    "UnknownName",
    "UsageError",
    "in_a_line",
    "is_interrupt",
    "placed",
    "shown",
    "unknown_name",
    "without_team",
]

NUMBERED = re.compile(r"(.*\D)(\d{1,9})", re.ASCII)  # as in "complex-10"


class ConevoError(Exception):
    """An error with one line for the user: what was wrong, where, what is allowed."""

    exit_code = 2


class UsageError(ConevoError):
    """The request cannot be carried out as written (exit code 2)."""


class UnknownName(UsageError):
    """A name is unknown."""


class EnvironmentFailure(ConevoError):
    """The environment failed: disk full, no permission, no such device (exit code 3)."""

    exit_code = 3


def is_interrupt(error: BaseException) -> bool:
    """Return whether an error was raised while Ctrl-C was handled, as some libraries do."""
    while error.__context__ is not None:
        error = error.__context__
        if isinstance(error, KeyboardInterrupt):
            return True
    return False


def shown(value: object, most: int = 60) -> str:
    """Return any value as messages show it, in at most ``most`` characters."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deeply, or an integer of very many digits
        text = f"a huge {type(value).__name__}"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def in_a_line(error: BaseException) -> str:
    """Return the name and the words of an error of another program, in one line.

    An error without words, as of ``assert n > 1``, has the statement that raised it instead.
    """
    try:
        words = str(error)
    except Exception:  # its own __str__ fails
        words = "(without words)"
    if not words.strip() and error.__traceback__ is not None:
        words = traceback.extract_tb(error.__traceback__)[-1].line or ""
    name = type(error).__name__
    return " ".join(f"{name}: {words}".split()) if words.strip() else name


def unknown_name(kind: str, name: str, allowed: Iterable[str], where: str = "") -> UnknownName:
    """Return the error for an unknown name, which names the nearest known one.

    Args:
        kind: of thing that the name should be of ("method", "key").
        name: the unknown name.
        allowed: the names that exist.
        where: where it was found ("in config.toml"), empty if obvious.
    """
    names = sorted(allowed)
    near = _by_number(name, names) or difflib.get_close_matches(name[:200], names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    place = f" {where}" if where else ""
    listed = ", ".join(names) if len(names) <= 40 else ", ".join(names[:40]) + ", ..."
    return UnknownName(
        f"unknown {kind} {shown(name, 200)}{place}{hint} (known: {listed or 'none'})"
    )


@contextmanager
def placed(key: str, place: str | None) -> Iterator[None]:
    """Add the setting to an error for an unknown name, if the setting's place is given.

    Args:
        key: the setting, "controller.name".
        place: where it was read, "in config.toml".
    """
    try:
        yield
    except UnknownName as error:
        if not place:
            raise
        raise UsageError(f"{key} {place}: {error}") from error


def _by_number(name: str, names: Iterable[str]) -> list[str]:
    """Return the name with the nearest number, if only the number is unknown."""
    if not (wanted := NUMBERED.fullmatch(name)):
        return []
    alike = [one for one in map(NUMBERED.fullmatch, names) if one and one[1] == wanted[1]]
    return [one[0] for one in sorted(alike, key=lambda one: abs(int(one[2]) - int(wanted[2])))[:1]]


def without_team(path: object, generations: Sequence[object]) -> UsageError:
    """Return the error for a run or shaping that has no champion.

    Args:
        path: its directory.
        generations: the records of its finished generations.
    """
    lost = "lost its champion.npz" if generations else "no finished generation yet"
    return UsageError(f"{path} has {lost}, so there is no team")
