"""Execute the examples of a page: ``python docs/run_page.py [--write] PAGE...``.

Blocks are executed from top to bottom in one empty folder, as a reader would do:

- ``sh`` by bash, ``python`` by Python; a ``text`` block right after one is its output;
- a block below ``<!-- file: NAME -->`` is written to that file;
- a block below ``<!-- not run: REASON -->`` is skipped, and so is its output.

Output is compared word by word; numbers, sizes of castes and times may differ. A command must fail
if its output contains "conevo: error". ``--write`` puts today's output into the page.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(
    r"(?:<!-- (?P<mark>[a-z ]+): (?P<about>[^\n]+?) -->\n)?```(?P<kind>\w+)\n(?P<text>.*?)```\n"
    r"(?:\n```text\n(?P<output>.*?)```\n)?",
    re.DOTALL,
)
WORDS = "low|med|hi|move|rest|stop|forward|left|right|reverse|non-specialized"
WORDS += "|[ABC]-(?:detector|gatherer|constructor)"
CASTES = re.compile(rf"(?:\b(?:{WORDS}) \d+(?:, )?)+")
CASTES_JSON = re.compile(r"\{(?:['\"][A-Za-z-]+['\"]: \d+,? ?)+\}")
NUMBER = re.compile(r"-?\d[\d,.]*(?:e[-+]?\d+)?")
SPAN = re.compile(r"# h # min|# min # s|# s\b")
SPACE = re.compile(r"(?<=\[) +| +(?= )")
REPLACED = ((CASTES, "CASTES"), (CASTES_JSON, "CASTES"), (NUMBER, "#"), (SPAN, "TIME"), (SPACE, ""))


@dataclass(frozen=True)
class Block:
    """One example: its kind and text, its output, and the output's place in the page."""

    kind: str
    text: str
    output: str | None
    span: tuple[int, int]
    file: str
    is_run: bool


def blocks(page):
    """Return the examples of a page's text."""
    found = []
    for m in FENCE.finditer(page):
        file = m["about"] if m["mark"] == "file" else ""
        is_run = m["kind"] in ("sh", "python") and m["mark"] != "not run"
        found.append(Block(m["kind"], m["text"], m["output"], m.span("output"), file, is_run))
    return found


def shape(text):
    """Return the part of an output that must be the same on every machine and in every run."""
    for pattern, word in REPLACED:
        text = re.sub(pattern, word, text)
    lines = [line.strip() for line in text.strip().splitlines()]
    return [line for k, line in enumerate(lines) if k == 0 or line != lines[k - 1]]


def execute(page, folder):
    """Execute a page's examples in a folder.

    Yields:
        Each executed block with its output.

    Raises:
        RuntimeError: a command failed that should not fail, or succeeded although it should fail.
    """
    bin_folder = folder / ".bin"
    bin_folder.mkdir()
    for name, command in (("conevo", "-m conevo"), ("python", "")):
        (bin_folder / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {command} "$@"\n')
        (bin_folder / name).chmod(0o755)
    (folder / "examples").symlink_to(ROOT / "examples")
    environment = os.environ | {
        "PATH": f"{bin_folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": os.pathsep.join(entry for entry in sys.path if entry),
        "NO_COLOR": "1",
    }
    for block in blocks(page):
        if block.file:
            (folder / block.file).write_text(block.text)
        if not block.is_run:
            continue
        start = ["bash", "-ec"] if block.kind == "sh" else [sys.executable, "-c"]
        done = subprocess.run(
            [*start, block.text],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=120,
        )
        must_fail = "conevo: error" in (block.output or "")
        if (done.returncode != 0) != must_fail:
            raise RuntimeError(f"exit code {done.returncode} of:\n{block.text}\n{done.stdout}")
        yield block, done.stdout


def differences(path):
    """Return the examples of a page whose output has changed, as text."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for block, output in execute(path.read_text(encoding="utf-8"), Path(folder)):
            if block.output is not None and shape(output) != shape(block.output):
                found.append(f"{block.text}printed\n{output}but the page shows\n{block.output}")
    return found


def rewrite(path):
    """Put today's output into a page."""
    page = path.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        done = list(execute(page, Path(folder)))
    for block, output in reversed(done):
        if block.output is not None:
            tidy = "".join(f"{line.rstrip()}\n" for line in output.splitlines())
            page = page[: block.span[0]] + tidy + page[block.span[1] :]
    path.write_text(page, encoding="utf-8")


def main():
    """Execute the pages named on the command line."""
    arguments = sys.argv[1:]
    write = "--write" in arguments
    if shutil.which("bash") is None:
        sys.exit("bash is needed to execute a page")
    for page in (Path(name) for name in arguments if name != "--write"):
        if write:
            rewrite(page)
        else:
            print(*differences(page), sep="\n")


if __name__ == "__main__":
    main()
