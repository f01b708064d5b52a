"""Fixtures that several folders of tests share."""

import os
from contextlib import contextmanager

import pytest

if os.environ.get("CONEVO_TEST_WARP_MODE"):  # "debug": array accesses out of bounds are errors
    import warp

    warp.config.mode = os.environ["CONEVO_TEST_WARP_MODE"]


@pytest.fixture
def cpu_blocks():
    """Return a context in which Warp runs a block's lanes on the CPU (its experimental fibers)."""
    import warp as wp

    @contextmanager
    def switched_on():
        before = wp.config.enable_cpu_blocks
        wp.config.enable_cpu_blocks = True
        try:
            yield
        finally:
            wp.config.enable_cpu_blocks = before

    return switched_on
