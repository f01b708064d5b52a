"""The files that a plan names, of worlds, methods and prey: copied, so that it can be moved.

On disk their paths are relative to the folder of the plan, in memory they are absolute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from conevo.outside import files_of
from conevo.runs.inputs import INPUTS, copy_input

__all__ = ["keep_files", "located", "renamed", "shown_as"]

Rename = Callable[[Any], Any]


def located(value: Any, folder: Path) -> Any:
    """Return a level or setting; if it names a file of a folder, with its absolute path.

    "FILE.py:NAME", a world or method in a file, always does; another text if that file exists.
    """
    if not isinstance(value, str):
        return value
    if ".py:" in value:
        return str(folder.resolve() / value)
    is_name = bool(Path(value).suffix) or "/" in value
    return str(folder.resolve() / value) if is_name and (folder / value).is_file() else value


def shown_as(value: Any) -> str:
    """Return a level as in labels: a file without its folder."""
    text = str(value)
    return Path(text).name if Path(text).is_absolute() else text


def renamed(value: Any, names: Mapping[str, str]) -> Any:
    """Return a level or setting with the file in it renamed."""
    if not isinstance(value, str):
        return value
    file, colon, environment = value.rpartition(":")
    if colon and file in names:
        return f"{names[file]}:{environment}"
    return names.get(value, value)


def keep_files(values: Iterable[Any], directory: Path) -> dict[str, str]:
    """Copy the files that are named into ``inputs/`` of a campaign.

    Args:
        values: levels and settings; files by their absolute paths.
        directory: the campaign's.

    Returns:
        Absolute path of each file -> path of its copy from that directory.

    Raises:
        UsageError: two files of one name.
        EnvironmentFailure: a file cannot be read or written.
    """
    names: dict[str, str] = {}
    for value in dict.fromkeys(value for value in values if isinstance(value, str)):
        file = Path(value.rpartition(":")[0] if ".py:" in value else value)
        if str(file) in names or not (file.is_absolute() and file.is_file()):
            continue
        files = files_of(file) if ".py:" in value else [file]
        kept = [copy_input(one, directory / INPUTS) for one in files]
        names[str(file)] = kept[0].relative_to(directory).as_posix()
    return names
