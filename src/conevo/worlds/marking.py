"""Which line of a world's file was running when its process died.

A copy of the file notes the number of each line of its Warp functions before running it, in a small
file that the process shares with the one that started it. A function that returns notes its
caller's line again, since that line continues with the result. The end of a ``while`` loop notes
the line of its condition again.
"""

import ast
import mmap
import os
from pathlib import Path

import numpy as np
import warp as wp

__all__ = ["MARKS", "last_mark", "mark", "marked", "read_mark", "statement_at"]

MARKS = "CONEVO_MARKS"  # the variable that names the shared file
LINES = 1_000_000  # more than a file has: a mark is the number of the file times this plus a line
BYTES = 4


def marked(text: str, file: int) -> str:
    """Return the text of a world's file with a mark before each line of its Warp functions."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any(map(_is_warp, node.decorator_list)):
            node.body = [
                *_parsed("_mark_of_caller = _last_mark()"),
                *_marked(node.body, file * LINES),
                *_parsed("_mark_line(_mark_of_caller)"),
            ]
    after = next(
        (k for k, line in enumerate(tree.body) if not _is_first(line)), len(tree.body)
    )  # imports of the future come first
    names = "last_mark as _last_mark, mark as _mark_line"
    tree.body[after:after] = _parsed(f"from {__name__} import {names}")
    return ast.unparse(tree)


def _parsed(text: str) -> list[ast.stmt]:
    return ast.parse(text).body


def _is_warp(decorator: ast.expr) -> bool:
    return ast.unparse(decorator).split("(")[0] in ("wp.func", "warp.func", "func")


def _is_first(line: ast.stmt) -> bool:
    return isinstance(line, ast.Expr) or (
        isinstance(line, ast.ImportFrom) and line.module == "__future__"
    )


def _marked(lines: list[ast.stmt], file: int, loop: ast.stmt | None = None) -> list[ast.stmt]:
    """Return lines with their marks; ``file`` is added to each, ``loop`` is the enclosing loop."""
    found: list[ast.stmt] = []
    for line in lines:
        is_text = isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant)
        if not is_text:
            found += _parsed(f"_mark_line({file + line.lineno})")
        if isinstance(line, ast.Return):
            found += _returning(line)
        if isinstance(line, ast.Continue) and isinstance(loop, ast.While):
            found += _parsed(f"_mark_line({file + loop.lineno})")
        around = line if isinstance(line, ast.For | ast.While) else loop
        for name in ("body", "orelse"):
            if inner := getattr(line, name, None):
                setattr(line, name, _marked(inner, file, around))
        if isinstance(line, ast.While):
            line.body += _parsed(f"_mark_line({file + line.lineno})")
        found.append(line)
    return found


def _returning(line: ast.Return) -> list[ast.stmt]:
    """Return the lines before a return, which compute its value and note the caller again."""
    whole = line.value
    values = whole.elts if isinstance(whole, ast.Tuple) else [whole] if whole else []
    found: list[ast.stmt] = []
    for k, value in enumerate(values):
        if not isinstance(value, ast.Constant):
            name = f"_returned_{line.lineno}_{k}"
            found += _parsed(f"{name} = {ast.unparse(value)}")
            values[k] = ast.Name(name)
    if whole and not isinstance(whole, ast.Tuple):
        line.value = values[0]
    return [*found, *_parsed("_mark_line(_mark_of_caller)")]


def statement_at(text: str, line: int) -> str:
    """Return the statement that starts at a line, in one line; only the head of a compound one."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.stmt) and node.lineno == line:
            body = getattr(node, "body", None)
            end = max(line, body[0].lineno - 1) if body else node.end_lineno
            return " ".join(" ".join(text.splitlines()[line - 1 : end]).split())
    return ""


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


@wp.func_native(f"return *reinterpret_cast<volatile int*>({_address}ull);")
def last_mark() -> int:  # type: ignore[empty-body]
    """Return the last mark."""
