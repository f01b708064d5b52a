"""A user's function as a setting, "FILE.py:FUNCTION", with the digest of its file next to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from conevo.errors import UsageError, in_a_line, unknown_name
from conevo.outside import Sort, source_of

__all__ = ["OwnFunction", "function_in", "keep"]


@dataclass(frozen=True)
class OwnFunction:
    """A function in a user's file.

    Attributes:
        address: "FILE.py:FUNCTION".
        digest: of the file's text and its imports, with the name of the function.
        function: the function.
    """

    address: str
    digest: str
    function: Any

    def call(self, *arguments: Any) -> Any:
        """Return the function's result.

        Raises:
            UsageError: the function raises an error.
        """
        try:
            return self.function(*arguments)
        except Exception as error:
            raise UsageError(f"{self.address} fails: {in_a_line(error)}") from error


def function_in(address: str, kind: Sort, other: str, digest: str, mark: str = "") -> OwnFunction:
    """Return the function at "FILE.py:FUNCTION".

    Args:
        address: of the function.
        kind: of its file, the name of the setting.
        other: the value of the setting that is not a function.
        digest: that the function must have; any if empty.
        mark: attribute of such functions, for the nearest right name.

    Raises:
        UsageError: the file cannot be run or has changed, or it has no such function.
    """
    file, _, name = address.rpartition(":")
    if not file.endswith(".py") or not name:
        raise unknown_name(kind, address, [other], "(and not FILE.py:FUNCTION)")
    source = source_of(Path(file), kind, digest.partition("-")[0])
    function = getattr(source.module, name, None)
    if function is None:
        own = [key for key, one in vars(source.module).items() if callable(one)]
        known = [key for key in own if hasattr(source.module.__dict__[key], mark or "__call__")]
        raise unknown_name("function", name, known, f"in {file}")
    if not callable(function):
        raise UsageError(f"{address} must be a function, not {type(function).__name__}")
    return OwnFunction(f"{source.files[0]}:{name}", f"{source.digest}-{name}", function)


def keep(params: Any, key: str, other: str, load: Callable[[str, str], OwnFunction]) -> None:
    """Put the whole address and the digest of a function into parameters.

    Args:
        params: with a setting ``key`` and its ``key_digest``.
        key: name of the setting.
        other: its value that is not a function.
        load: returns the function at an address with a digest.

    Raises:
        UsageError: there is no such function, or it has another digest.
    """
    value, digest = getattr(params, key), getattr(params, f"{key}_digest")
    if value == other:
        if digest:
            raise UsageError(f"world.{key}_digest belongs to a file, not to {value!r}")
        return
    found = load(value, digest)
    if digest not in ("", found.digest):
        raise UsageError(
            f"{key} {value!r} have changed: the digest is {found.digest}, not {digest}"
        )
    object.__setattr__(params, key, found.address)
    object.__setattr__(params, f"{key}_digest", found.digest)
