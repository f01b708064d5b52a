"""Fixtures that several folders of tests share."""

from contextlib import contextmanager

import pytest


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
