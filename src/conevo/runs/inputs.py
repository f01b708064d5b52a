"""The files that a run needs besides conevo, copied into it: its world's, its method's, others.

A value with a digest next to it names a file, as ``world`` and ``world_digest`` in ``[run]``, so do
``method`` and ``method_digest``,
``prey`` and ``prey_digest`` in ``[world]``. It may name a part of the file, "FILE.py:NAME". The
copies are named from the directory, so that it can be moved, and looked at where the original files
are changed or gone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from conevo.errors import UsageError
from conevo.outside import files_of
from conevo.reading import read_bytes
from conevo.runs.durable import replace_file, writing

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig

__all__ = ["INPUTS", "copy_input", "keep_inputs"]

INPUTS = "inputs"  # folder of a run, shaping or campaign


def keep_inputs(config: RunConfig, directory: Path) -> RunConfig:
    """Copy the files of a run into ``inputs/`` and return its configuration with the copies.

    Args:
        config: of the run.
        directory: the run's, shaping's or campaign's; it may have inputs already.

    Raises:
        UsageError: a file has changed since the configuration was made, or ``inputs/`` has
            another file of its name.
        EnvironmentFailure: a file cannot be read or written.
    """
    folder = directory / INPUTS
    entry, method, params = config.entry, config.method_entry, config.world_params
    if entry.file:
        from conevo.worlds.outside import load as load_world

        entry = load_world(_copied(entry.files, folder), entry.digest)
    if method.file:
        from conevo.evolution.methods.outside import load as load_method

        method = load_method(_copied(method.files, folder), method.digest)
    for field in dataclasses.fields(params):
        if getattr(params, f"{field.name}_digest", ""):
            file, name = getattr(params, field.name), ""
            if ".py:" in file:
                file, _, name = file.rpartition(":")
            files = files_of(Path(file)) if name else [Path(file)]
            kept = f"{_copied(map(str, files), folder)}{f':{name}' if name else ''}"
            params = dataclasses.replace(params, **{field.name: kept})
    if (entry, method, params) == (config.entry, config.method_entry, config.world_params):
        return config
    return dataclasses.replace(config, entry=entry, method_entry=method, world_params=params)


def _copied(files: Iterable[str], folder: Path) -> Path:
    """Return the copy of the first of some files in a folder, after copying all of them."""
    first, *_ = [copy_input(Path(one), folder) for one in files]
    return first


def copy_input(file: Path, folder: Path) -> Path:
    """Return the copy of a file in a folder, made by now.

    Raises:
        UsageError: another file of its name is there.
        EnvironmentFailure: it cannot be read or written.
    """
    content, copy = read_bytes(file), folder / file.name
    if copy.is_file():
        if read_bytes(copy) != content:
            raise UsageError(f"{file}: another input is named {file.name}; rename one of them")
        return copy
    with writing(copy):
        folder.mkdir(exist_ok=True)
    replace_file(copy, content)
    return copy
