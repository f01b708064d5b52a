"""Which line of a world's file was running when its process died.

A copy of the file notes the number of each line of its Warp functions before running it, in a small
file that the process shares with the one that started it.
"""

import ast
import mmap
import os
from pathlib import Path

import numpy as np
import warp as wp

__all__ = ["MARKS", "mark", "marked", "read_mark"]

MARKS = "CONEVO_MARKS"  # the variable that names the shared file
LINES = 1_000_000  # more than a file has: a mark is the number of the file, times this, plus a line
BYTES = 4


def marked(text: str, file: int) -> str:
    """Return the text of a world's file with a mark before each line of its Warp functions."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any(map(_is_warp, node.decorator_list)):
            for inner in ast.walk(node):
                for name in ("body", "orelse"):
                    lines = getattr(inner, name, None)
                    if isinstance(lines, list):
                        setattr(inner, name, _marked(lines, file))
    after = next(
        (k for k, line in enumerate(tree.body) if not _is_first(line)), len(tree.body)
    )  # imports of the future come first
    tree.body[after:after] = ast.parse(f"from {__name__} import mark as _mark_line").body
    return ast.unparse(tree)


def _is_warp(decorator: ast.expr) -> bool:
    return ast.unparse(decorator).split("(")[0] in ("wp.func", "warp.func", "func")


def _is_first(line: ast.stmt) -> bool:
    return isinstance(line, ast.Expr) or (
        isinstance(line, ast.ImportFrom) and line.module == "__future__"
    )


def _marked(lines: list[ast.stmt], file: int) -> list[ast.stmt]:
    found: list[ast.stmt] = []
    for line in lines:
        is_text = isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)
        if not is_text:
            found += ast.parse(f"_mark_line({file * LINES + line.lineno})").body
        found.append(line)
    return found


def read_mark(path: Path) -> tuple[int, int] | None:
    """Return the number of the file and the line that was marked last, None if none was."""
    number = int(np.frombuffer(path.read_bytes(), np.int32)[0])
    return divmod(number, LINES) if number else None


if MARKS in os.environ:  # in the process that may die
    with open(os.environ[MARKS], "r+b") as shared:
        _memory = mmap.mmap(shared.fileno(), BYTES)
    _address = np.frombuffer(_memory, np.int32).ctypes.data
else:
    _address = 0


@wp.func_native(f"*reinterpret_cast<volatile int*>({_address}ull) = number;")
def mark(number: int):  # type: ignore[no-untyped-def]
    """Note that a line is about to run."""
