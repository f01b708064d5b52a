"""Making, launching and identifying kernels: one text for CPU threads and CUDA blocks.

One world is one block. On the CPU a block has a single lane that does all robots in turn, and
slices of the batch are launched from several Python threads (Warp releases the GIL); on a CUDA
device each lane takes its share of the robots and ``barrier`` separates the phases. Each phase
writes only its own robot's data, so both give the same bits.
"""

import hashlib
import os
import re
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from typing import Any

import warp as wp

from conevo.errors import EnvironmentFailure, UsageError

__all__ = [
    "OutOfMemory",
    "build",
    "building",
    "kernel_hash",
    "launch",
    "memory_named",
    "options",
    "start",
]

# Measured: switching off adjoints and unrolling pays; fast_math and -O3 do not. No fused
# multiply-add: CPU and CUDA must agree bit for bit.
options = {"enable_backward": False, "max_unroll": 0, "fuse_fp": False}


# Held while kernels are made, identified, compiled and loaded: Warp can generate code for only one
# of them at a time.
building = threading.RLock()
_is_started = False


class OutOfMemory(EnvironmentFailure):
    """A device has less free memory than was requested."""


def start() -> None:
    """Initialize Warp once, quietly.

    Raises:
        EnvironmentFailure: the folder for compiled kernels cannot be made.
    """
    global _is_started
    with building:
        if not _is_started:
            if not os.environ.get("WARP_CACHE_PATH"):
                os.environ.pop("WARP_CACHE_PATH", None)  # an empty one is not the working directory
            wp.config.log_level = wp.LOG_WARNING
            with _without_line(b"CUDA driver"), _cache_named():  # where there is no GPU driver
                wp.init()
            _is_started = True


def build(kernel: Any, device: str, lanes: int) -> None:
    """Compile and load a kernel unless that has already been done.

    Args:
        kernel: made with ``options``.
        device: "cpu" or a CUDA device.
        lanes: lanes of a block.

    Raises:
        UsageError: Warp cannot compile a function of the kernel.
        EnvironmentFailure: the compiled kernel cannot be written.
    """
    with building, _cache_named():
        try:
            kernel.module.load(wp.get_device(device), lanes)
        except (OSError, UsageError):
            raise
        except Exception as error:
            raise UsageError(_mistake(error)) from error


@contextmanager
def memory_named(device: str) -> Iterator[None]:
    """Turn a lack of memory on a device into one error, without Warp's own line about it.

    Raises:
        OutOfMemory: an array does not fit into the free memory.
    """
    try:
        with nullcontext() if device == "cpu" else _without_line(b"out of memory"):
            yield
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "Failed to allocate" not in str(error):
            raise
        raise OutOfMemory(
            f"device {device!r}: too little free memory; end other programs that use it, or play "
            f"fewer scenarios at once"
        ) from error


@contextmanager
def _cache_named() -> Iterator[None]:
    """Turn a file system's refusal of compiled kernels into an error that names their folder."""
    try:
        yield
    except OSError as error:
        raise EnvironmentFailure(
            f"compiled kernels cannot be kept in {wp.config.kernel_cache_dir}: {error.strerror}; "
            f"set the variable WARP_CACHE_PATH to a writable folder"
        ) from error


def _mistake(error: Exception) -> str:
    """Return "FILE:LINE: MISTAKE" for an error in the text of a Warp function."""
    words = str(error.args[0] if error.args else error)
    places = re.findall(r'Error while parsing function "(\w+)" at (.+):(\d+):\n(.*)\n', words)
    what = " ".join(words.rpartition("\n;")[2].split()).rstrip(".") or type(error).__name__
    if not places:
        return f"the world's kernel cannot be compiled: {what}"
    function, file, line, text = places[-1]
    return f"{file}:{line}: {what} (in {function}: {text.strip()})"


@contextmanager
def _without_line(word: bytes) -> Iterator[None]:
    """Drop only the lines of Warp's native code that contain a word."""
    try:
        os.fstat(2)
    except OSError:  # started without a standard error: nothing to keep clean
        yield
        return
    sys.stderr.flush()
    with tempfile.TemporaryFile() as caught, open(os.dup(2), "wb", buffering=0) as real:
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(real.fileno(), 2)
            caught.seek(0)
            for line in caught:
                if word not in line:
                    real.write(line)


def launch(
    kernel: Any,
    n_worlds: int,
    inputs: Sequence[Any],
    *,
    device: str = "cpu",
    n_threads: int = 1,
    lanes: int = 1,
) -> None:
    """Run ``kernel`` for worlds 0..n_worlds-1; its last argument is set here.

    The kernel's arguments are ``inputs`` and ``first``, the first world of a slice. Worlds are
    independent, so neither the slicing nor the number of threads changes a result.

    Args:
        kernel: made with ``options``; its thread index is ``(world in slice, lane)``.
        n_worlds: number of worlds.
        inputs: kernel arguments before ``first``.
        device: "cpu" or a CUDA device.
        n_threads: CPU threads to launch from.
        lanes: lanes of a block; 1 on the CPU unless CPU blocks are being tested.
    """
    if device != "cpu":
        wp.launch_tiled(kernel, dim=[n_worlds], inputs=[*inputs, 0], block_dim=lanes, device=device)
        wp.synchronize_device(device)
        return

    def run(piece: tuple[int, int]) -> None:
        first, count = piece
        wp.launch_tiled(kernel, dim=[count], inputs=[*inputs, first], block_dim=lanes, device="cpu")

    # Warp's CPU code keeps a static pointer to the block's scratch memory: written at entry, read
    # by debug assertions and by fibers only. So a release kernel may run on several threads.
    if n_threads == 1 or wp.config.mode != "release" or wp.config.enable_cpu_blocks:
        for piece in _pieces(n_worlds, 1):
            run(piece)
    else:
        pool = ThreadPoolExecutor(n_threads)
        try:
            for _ in pool.map(run, _pieces(n_worlds, n_threads)):
                pass
        finally:  # after Ctrl-C, wait only for slices that have started
            pool.shutdown(cancel_futures=True)


def _pieces(n: int, n_threads: int) -> Iterator[tuple[int, int]]:
    """Cut n worlds into slices small enough that all threads end together."""
    size = max(1, min(32, n // (4 * n_threads)))  # 32: 1.04 times as fast as 16 (measured)
    for first in range(0, n, size):
        yield first, min(size, n - first)


def kernel_hash(*kernels: Any) -> str:
    """Return 16 hex digits that change with any function, constant or option of the kernels.

    It combines Warp's version and Warp's own content hash of the kernels' modules, which also
    decides whether a compiled kernel may be used again.
    """
    digest = hashlib.blake2b(wp.__version__.encode(), digest_size=8)
    with building:
        for kernel in kernels:
            digest.update(kernel.module.get_module_hash())
    return digest.hexdigest()
