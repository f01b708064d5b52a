"""jax, started so that a result does not depend on how many epochs are played together.

A processor with fused operations computes a * b + c with one rounding or with two. XLA chooses
again in every program, so the same epoch could differ among other epochs, or when it is recorded.
conevo lets XLA use the instructions of AVX, which have none. Then every sum is rounded as in numpy,
and a controller's outputs equal ``Controller.forward`` bit for bit.

XLA reads this setting when it starts. If a program has used jax before, it stays as it is.
"""

from __future__ import annotations

import functools
import io
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import jax
import numpy as np

from conevo.errors import EnvironmentFailure, UsageError, in_a_line
from conevo.simulators.tasks import versions

__all__ = ["started"]

PLAIN = "--xla_cpu_max_isa=AVX"


@functools.cache
def started() -> str:
    """Start jax on the CPU, load JaxMARL, and return their versions.

    Returns:
        "jaxmarl 0.2.0, jax 0.10.2, jaxlib 0.10.2", and "fused" if operations are.

    Raises:
        UsageError: jax is set to 64 bits.
        EnvironmentFailure: JaxMARL cannot be loaded.
    """
    if jax.config.jax_enable_x64:
        raise UsageError(
            "jax is set to 64 bits (JAX_ENABLE_X64), but tasks of JaxMARL are played in 32"
        )
    with _settings():
        jax.config.update("jax_cpu_enable_async_dispatch", False)
        fused = ", fused" if _is_fused() else ""
    try:
        with _silence():
            import jaxmarl  # noqa: F401
    except ImportError as error:
        text = f"the package jaxmarl cannot be loaded: {in_a_line(error)}"
        raise EnvironmentFailure(text) from error
    return versions("jaxmarl", "jax", "jaxlib") + fused


@contextmanager
def _silence() -> Iterator[None]:
    """Keep JaxMARL from printing which packages it finds, and from replacing the streams."""
    names = ("stdout", "stderr", "__stdout__", "__stderr__")
    before = {name: getattr(sys, name) for name in names}
    try:
        for name in names:
            setattr(sys, name, io.StringIO())
        yield
    finally:
        for name, stream in before.items():
            setattr(sys, name, stream)


@contextmanager
def _settings() -> Iterator[None]:
    """Set what jax reads from the environment as it starts.

    Choice: one thread for jax. conevo's own threads play other epochs at the same time.
    """
    before = dict(os.environ)
    flags = before.get("XLA_FLAGS", "")
    if platform.machine() in ("x86_64", "AMD64") and "xla_cpu_max_isa" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {PLAIN}".strip()
    os.environ.setdefault("NPROC", "1")
    try:
        yield
    finally:
        for name in ("XLA_FLAGS", "NPROC"):
            os.environ.pop(name, None)
            if name in before:
                os.environ[name] = before[name]


def _is_fused() -> bool:
    """Return whether a * a - b is computed with one rounding."""
    a, b = np.full(64, 1 + 2.0**-12, np.float32), np.full(64, 1 + 2.0**-11, np.float32)
    with jax.default_device(jax.devices("cpu")[0]):
        return bool(np.any(np.asarray(jax.jit(lambda a, b: a * a - b)(a, b))))
