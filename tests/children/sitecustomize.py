"""Share Warp's precompiled headers between the processes of the tests.

Warp compiles its headers once for each process, which takes three seconds, and its kernels with
them. The kernels do not depend on who has compiled the headers. Python imports this module when it
starts, in each process that a test starts: ``tests/conftest.py`` puts the folder on their path.

NumPy's matrices are small here: further threads of OpenBLAS wait for work by spinning, which takes
as much time again from the other core as the work.
"""

import os
import sys
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported
COMPILER = "warp._src.build"
HEADERS = "CONEVO_TEST_HEADERS"  # the folder of the headers that all processes share


def link(known, folder):
    """Link the headers of a folder to another one, where they are missing."""
    for header in Path(known).glob("*.pch"):
        with suppress(OSError):  # another process was first, or the folder is gone
            (Path(folder) / header.name).hardlink_to(header)


def sharing(build_cpu, shared):
    """Return Warp's compiler with headers that come from a shared folder, and go there."""

    def build(*arguments, pch_dir=None, **options):
        if pch_dir:
            link(shared, pch_dir)
        done = build_cpu(*arguments, pch_dir=pch_dir, **options)
        if pch_dir:
            link(pch_dir, shared)  # complete: no process sees one that is being written
        return done

    return build


class Finder:
    """Change the compiler when Warp is imported, and import nothing before."""

    @classmethod
    def find_spec(cls, name, path, target=None):
        if name != COMPILER:
            return None
        sys.meta_path.remove(cls)
        spec = PathFinder.find_spec(name, path)
        execute = spec.loader.exec_module

        def exec_module(module):
            execute(module)
            module.build_cpu = sharing(module.build_cpu, os.environ[HEADERS])

        spec.loader.exec_module = exec_module
        return spec


if os.environ.get(HEADERS) and COMPILER not in sys.modules:
    sys.meta_path.insert(0, Finder)
