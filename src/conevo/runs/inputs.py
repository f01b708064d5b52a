"""The files that a run needs besides conevo, copied into its directory: a world's, and its prey.

A value with a digest next to it names a file, as ``world`` and ``world_digest`` in ``[run]``,
``prey`` and ``prey_digest`` in ``[world]``. The copies are named from the directory, so that it can
be moved, and looked at where the original files are changed or gone.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from conevo.errors import UsageError
from conevo.reading import read_bytes
from conevo.runs.durable import replace_file, writing

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig

__all__ = ["INPUTS", "copy_input", "keep_inputs"]

INPUTS = "inputs"  # folder of a run, shaping or campaign


def keep_inputs(config: RunConfig, directory: Path) -> RunConfig:
    """Copy what a run needs into ``inputs/`` and return its configuration with these files.

    Args:
        config: of the run.
        directory: the run's, shaping's or campaign's; it may have inputs already.

    Raises:
        UsageError: a file has changed since the configuration was made, or another one of its name
            is there.
        EnvironmentFailure: a file cannot be read or written.
    """
    folder = directory / INPUTS
    entry, params = config.entry, config.world_params
    if entry.file:
        from conevo.worlds.outside import load

        file, *_ = [copy_input(Path(one), folder) for one in entry.files]
        entry = load(file, entry.digest)
    for field in dataclasses.fields(params):
        if getattr(params, f"{field.name}_digest", ""):
            kept = copy_input(Path(getattr(params, field.name)), folder)
            params = dataclasses.replace(params, **{field.name: str(kept)})
    if entry is config.entry and params is config.world_params:
        return config
    return dataclasses.replace(config, entry=entry, world_params=params)


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
