"""Writing a team to a file, in the format that its name ends with."""

from __future__ import annotations

from pathlib import Path

from conevo.errors import UsageError, unknown_name
from conevo.export.team import EvolvedTeam
from conevo.runs.durable import write_new

__all__ = ["FORMATS", "content_of", "export", "format_of"]

FORMATS = {
    ".py": "Python, which needs numpy alone",
    ".npz": "weights as numpy arrays",
    ".onnx": "ONNX graph",
    ".pt2": "PyTorch program",
    ".h": "C header",
}
"""Formats by the ending of a file's name."""
WITH_FAST = (".onnx", ".pt2")
"""Those that exist with a faster arithmetic, too."""


def format_of(path: Path, is_fast: bool = False) -> str:
    """Return the ending in ``FORMATS`` of a file's name.

    Raises:
        UsageError: another ending, or a format without the fast arithmetic.
    """
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise unknown_name("ending", path.suffix, FORMATS, f"of {path}")
    if is_fast and ending not in WITH_FAST:
        raise UsageError(f"{path}: only {' and '.join(WITH_FAST)} exist with fast arithmetic")
    return ending


def content_of(team: EvolvedTeam, path: Path, is_fast: bool = False) -> bytes:
    """Return the content of a team's file; see ``export``."""
    ending = format_of(path, is_fast)
    if ending == ".py":
        from conevo.export.python_file import to_python

        return to_python(team)
    if ending == ".npz":
        from conevo.export.arrays import to_npz

        return to_npz(team)
    if ending == ".onnx":
        from conevo.export.onnx_graph import to_onnx

        return to_onnx(team, is_fast)
    if ending == ".pt2":
        from conevo.export.torch_program import to_torch

        return to_torch(team, is_fast)
    from conevo.export.c_header import to_c

    return to_c(team, path.stem)


def export(team: EvolvedTeam, path: Path | str, *, fast: bool = False) -> Path:
    """Write a team to a file that runs without conevo, and return its path.

    Args:
        team: to be written.
        path: of the file; its name ends in .py, .npz, .onnx, .pt2 or .h, which selects the format.
        fast: for .onnx and .pt2, matrix products in place of the kernels' order of additions. The
            results differ in the last digits, and in time by more (docs/export.md).

    Raises:
        UsageError: another ending, or another file is in its place.
        EnvironmentFailure: the package of the format is not installed, or the file cannot be
            written.
    """
    path = Path(path)
    format_of(path, fast)
    write_new({path: content_of(team, path, fast)}, "--to")
    return path
