"""The error for an adapter whose package is missing, or does not fit."""

from __future__ import annotations

from conevo.errors import UsageError

__all__ = ["lacking"]


def lacking(extra: str, error: ImportError) -> UsageError:
    """Return the error for an adapter that cannot be imported.

    Args:
        extra: the adapter, and the extra of conevo that installs its package.
        error: the reason.
    """
    why = f"{error.name} is not installed" if isinstance(error, ModuleNotFoundError) else f"{error}"
    return UsageError(
        f"conevo.adapters.{extra} needs other packages ({why}): pip install 'conevo[{extra}]'"
    )
