"""The code that decides results, as one digest, and which code made which generations of a run."""

from __future__ import annotations

import functools
import hashlib
import operator
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import conevo
from conevo.errors import UsageError
from conevo.runs.directory import CONFIG
from conevo.terms import quoted
from conevo.worlds.registry import refuse_earlier

__all__ = [
    "DECIDING",
    "changes_text",
    "code_digest",
    "code_spans",
    "current_code",
    "last_code",
    "other_code",
    "refuse_other_code",
    "refuse_other_kernels",
    "sessions_of",
    "version",
]

DECIDING = (
    "rng.py",
    "outside.py",
    "kernels",
    "worlds",
    "simulators",
    "controllers",
    "specialization",
    "evolution",
    "runs/champions.py",
    "runs/evaluation.py",
    "runs/lab.py",
    "runs/loop.py",
    "runs/session.py",
    "runs/testing.py",
)
"""Files and folders of the package, without the drawing of worlds (``drawn*.py``).

A world in a file has its own digest.
"""

MAKING = ("numpy", "warp", "device")  # they affect results too; changes are shown
Record = Mapping[str, Any]
Span = tuple[str, int, int | None]  # version or device, first generation, last (None: the newest)


@functools.cache
def code_digest() -> str:
    """Return twelve hex digits that change with any text that decides results.

    Choice: comments and docstrings count. A text is the same in every version of Python, installed
    or not, which no parser's output is. A release that changes a comment only asks for a flag once;
    a change that goes unnoticed costs a result.
    """
    package = Path(conevo.__file__).parent
    found = hashlib.blake2b(digest_size=6)
    for name in DECIDING:
        path = package / name
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            if file.name.startswith("drawn"):
                continue
            text = file.read_bytes().replace(b"\r\n", b"\n")
            found.update(f"{file.relative_to(package).as_posix()} {len(text)}\n".encode() + text)
    return found.hexdigest()


@functools.cache
def version(package: str) -> str:
    """Return the installed version of a package, "source" where it runs without being installed."""
    from importlib import metadata  # takes longer to load than a run takes to be shown

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "source"


def current_code() -> str:
    """Return this conevo's version with its code: "0.2.0 (1f0c9a5e77b2)"."""
    return _named(version("conevo"), code_digest())


def last_code(provenance: Record) -> str:
    """Return the version with its code that last continued a run."""
    return _code_of([provenance, *provenance["sessions"]][-1])


def sessions_of(provenance: Record, before: int = 0) -> list[Record]:
    """Return the sessions of a run, each with its versions and device.

    Args:
        provenance: of the run; conevo 0.1.0 recorded versions there only.
        before: generations of earlier stages, if it is a stage of a shaping.
    """
    shared = {name: provenance[name] for name in MAKING if name in provenance}
    return [
        shared | session | {"from_generation": before + session["from_generation"]}
        for session in provenance["sessions"]
    ]


def refuse_other_code(path: Path, task: str, code: str, is_accepted: bool) -> None:
    """Raise UsageError unless this conevo may continue the results of another one.

    Args:
        path: of the run or shaping.
        task: world and environment; worlds of earlier versions are refused.
        code: version and code that made it so far.
        is_accepted: whether other code is allowed.
    """
    refuse_earlier(task, path)
    if not is_accepted and (problem := other_code(path, code)):
        raise UsageError(
            f"{problem}: use that version, or continue with 'conevo resume {quoted(path)} "
            f"--accept-other-code'"
        )


def refuse_other_kernels(path: Path, provenance: Record, fingerprint: str) -> None:
    """Raise UsageError unless a run was made with the kernels that are here.

    Args:
        path: of the run.
        provenance: of the run.
        fingerprint: of the simulator here.
    """
    made = provenance["kernel_hash"]
    if fingerprint != made and " " in made:  # of a task of another package
        raise UsageError(
            f"{path} was made with {made}, and here is {fingerprint}: install the versions that "
            f"made it, or start another run with 'conevo run --config {quoted(path / CONFIG)}'"
        )
    if fingerprint != made:
        raise UsageError(
            f"{path} was made with other kernels ({made}, here "
            f"{fingerprint}): install conevo {provenance['conevo']} and warp-lang "
            f"{provenance['warp']}, or start another run with "
            f"'conevo run --config {quoted(path / CONFIG)}'"
        )


def other_code(path: Path, code: str) -> str:
    """Return a message if ``code``, of the run at ``path``, is not this conevo's, else nothing."""
    here = current_code()
    if code == here:
        return ""
    return f"{path} was made by conevo {code}, and this is {here}, which may give other results"


def code_spans(sessions: Sequence[Record]) -> list[Span]:
    """Return the generations made by each code, given the sessions of a run."""
    return _spans(sessions, _code_of)


def changes_text(sessions: Sequence[Record]) -> list[str]:
    """Return a line for each version or device that changed between sessions.

    For example "made by 2 versions: 0.1.0 (0f3e5a7712bc) generations 0-11, 0.2.0 (5d11c0ffee00)
    from 12".
    """
    lines = []
    codes = code_spans(sessions)
    if len(codes) > 1:
        lines.append(f"made by {len({one[0] for one in codes})} versions: {_text(codes)}")
    for name in MAKING:
        found = _spans(sessions, operator.itemgetter(name))
        if len(found) > 1:
            lines.append(f"made with more than one {name}: {_text(found)}")
    return lines


def _spans(sessions: Sequence[Record], thing: Callable[[Record], str]) -> list[Span]:
    """Return the generations made with each value of ``thing``, in order.

    A session begins at a checkpoint, and newer generations are made again. So a session's
    generations end where those of the next one begin.
    """
    starts = [session["from_generation"] for session in sessions]
    found: list[Span] = []
    ends = [*starts[1:], None][: len(starts)]
    for session, start, end in zip(sessions, starts, ends, strict=True):
        one = thing(session)
        if found and found[-1][0] == one:
            start = found.pop()[1]
        if end is None or end > start:
            found.append((one, start, None if end is None else end - 1))
    return found


def _text(spans: Sequence[Span]) -> str:
    return ", ".join(
        f"{one} from {first}"
        if last is None
        else f"{one} generation {first}"
        if first == last
        else f"{one} generations {first}-{last}"
        for one, first, last in spans
    )


def _code_of(session: Record) -> str:
    """Return version and code of a session; conevo 0.1.0 recorded neither."""
    return _named(session.get("conevo", "0.1.0"), session.get("code", "code not recorded"))


def _named(version: str, code: str) -> str:
    return f"{version} ({code})"
