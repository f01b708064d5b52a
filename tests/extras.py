"""Packages of an extra: tests that need one are skipped without it.

Where CONEVO_TEST_EXTRAS=required is set, they fail instead.
"""

from __future__ import annotations

import os
from importlib.util import find_spec

import pytest

__all__ = ["need"]


def need(*packages: str) -> None:
    """Skip the tests of a module, or fail, if a package is missing."""
    if missing := [one for one in packages if find_spec(one) is None]:
        why = f"{missing[0]} is not installed"
        if os.environ.get("CONEVO_TEST_EXTRAS") == "required":
            pytest.fail(f"CONEVO_TEST_EXTRAS=required, but {why}", pytrace=False)
        pytest.skip(why, allow_module_level=True)
