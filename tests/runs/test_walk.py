"""The path of a setting, from the flag to the kernel's parameters, is short."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import conevo
from conevo.cli.main import main
from conevo.runs.start import start
from conevo.worlds.protocol import kernel_params
from conevo.worlds.rollout import Rollout

ROOT = Path(conevo.__file__).parent
MARK = 4321.5  # no other setting has this value


class Arrived(BaseException):
    """The kernel's parameters contain the value."""


def holds(value: Any, depth: int = 3) -> bool:
    """Return whether a value is or contains the traced one."""
    if isinstance(value, float | str):
        return str(MARK) in str(value)
    inner: Any = ()
    if isinstance(value, Mapping):
        inner = value.values()
    elif isinstance(value, list | tuple):
        inner = value
    elif not isinstance(value, type) and type(value).__module__.startswith("conevo."):
        inner = getattr(value, "__dict__", {}).values()
    return depth > 0 and any(holds(one, depth - 1) for one in list(inner))


def test_a_setting_passes_at_most_twenty_files_from_flag_to_kernel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert callable(start)
    assert callable(Rollout)  # loaded here, so that the loading of modules is not part of the path
    passed: list[str] = []

    def follow(frame: FrameType, event: str, value: Any) -> None:
        code = frame.f_code
        file = Path(code.co_filename)
        if event not in ("call", "return") or not file.is_relative_to(ROOT):
            return
        if event == "call" and code.co_flags & inspect.CO_OPTIMIZED:  # of a function
            names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
            value = [frame.f_locals.get(name) for name in names]
        if holds(value):
            passed.append(file.relative_to(ROOT).as_posix())
        if event == "return" and code is kernel_params.__code__:
            assert value.energy == MARK
            raise Arrived

    settings = ("--preset", "smoke", "--set", f"world.energy={MARK}")
    try:
        sys.setprofile(follow)
        main(("run", "rover/complex-1", *settings))
    except Arrived:
        pass
    finally:
        sys.setprofile(None)
    walk = list(dict.fromkeys(passed))
    assert walk[0] == "cli/main.py"
    assert any(file.startswith("worlds/rover") for file in walk)
    assert len(walk) <= 20, walk
