"""Packages and programs that some formats need.

Tests that need a missing one are skipped. If CONEVO_TEST_EXPORT=required is set, they fail
instead, except those of PyTorch, which is too large for a few tests.
"""

import importlib
import os
import shutil

import pytest


def package(name):
    """Return a package, or skip the test."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return missing(name, is_optional=name == "torch")


def compiler(name="gcc"):
    """Return the path of a compiler, or skip the test; one for C++ is optional."""
    return shutil.which(name) or missing(name, is_optional=name != "gcc")


def missing(name, is_optional=False):
    if os.environ.get("CONEVO_TEST_EXPORT") == "required" and not is_optional:
        pytest.fail(f"CONEVO_TEST_EXPORT=required, but {name} is not installed", pytrace=False)
    return pytest.skip(f"{name} is not installed")
