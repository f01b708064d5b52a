"""One dataclass in one file, whole or refused.

Its fields are arrays, plain values (int, float, bool, str), mappings from names to plain values and
further dataclasses of all these, whose fields are named with dots ("progress.generation"). Arrays
go into an uncompressed npz (never pickled), everything else as JSON next to them, with a digest
over all of it: a flipped bit is noticed anywhere, also where zip has no CRC. The file contains an
``identity``, so that a file of another method or another run is refused.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from conevo.errors import UsageError, shown
from conevo.reading import DamagedFile, check, packed, read_arrays
from conevo.runs.durable import replace_file

__all__ = [
    "UnusableFile",
    "content_digest",
    "difference",
    "load",
    "load_like",
    "refuse_unkept",
    "save",
]

FORMAT = 1
PLAIN = (int, float, bool, str)
Record = TypeVar("Record")


class UnusableFile(DamagedFile):
    """A checkpoint or team file that is corrupt, truncated or foreign."""


def save(path: Path, record: Any, identity: Mapping[str, str]) -> None:
    """Write a dataclass.

    Args:
        path: the file; it is replaced at once.
        record: a dataclass instance.
        identity: the run and method of the file; ``load`` requires the same.

    Raises:
        UsageError: a field has a value that cannot be kept.
        EnvironmentFailure: the file cannot be written.
    """
    import numpy as np

    refuse_unkept(record, type(record).__name__)
    leaves = _leaves(record)
    arrays = {name: value for name, value in leaves.items() if isinstance(value, np.ndarray)}
    rest = {name: value for name, value in leaves.items() if name not in arrays}
    about = {"format": FORMAT, "identity": dict(identity), "fields": rest}
    about["digest"] = _digest(about, arrays)
    fields = {f"field.{name}": value for name, value in arrays.items()}
    replace_file(path, packed(json.dumps(about), fields))


def refuse_unkept(record: Any, owner: str) -> None:
    """Raise UsageError if this is not a dataclass, or has a field that a file cannot contain.

    Args:
        record: the dataclass.
        owner: its owner, for the message.
    """
    import numpy as np

    if not dataclasses.is_dataclass(record):
        raise UsageError(f"the state of {owner} must be a dataclass, not {type(record).__name__}")
    for name, value in _leaves(record).items():
        is_array = type(value) is np.ndarray and not value.dtype.hasobject
        if not is_array and type(value) not in PLAIN:
            what = "an array of objects" if type(value) is np.ndarray else type(value).__name__
            raise UsageError(
                f"the state of {owner} cannot be kept: {name} is {what}; a state has arrays of "
                f"numbers, int, float, bool, str and dataclasses of these"
            )


def _leaves(record: Any, prefix: str = "") -> dict[str, Any]:
    """Return the values of a dataclass by name; fields of fields have names with dots."""
    found: dict[str, Any] = {}
    for field in _stored(record):
        name, value = f"{prefix}{field.name}", getattr(record, field.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            found |= _leaves(value, f"{name}.")
        elif isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
            found |= {f"{name}.{key}": _plain(one) for key, one in value.items()}
        else:
            found[name] = _plain(value)
    return found


def _stored(record: Any) -> list[dataclasses.Field[Any]]:
    """Return the fields that ``__init__`` takes; others follow from them."""
    return [field for field in dataclasses.fields(record) if field.init]


def _plain(value: Any) -> Any:
    """Return a number of numpy as one of Python."""
    import numpy as np

    return value.item() if isinstance(value, np.generic) else value


def load(path: Path, record_class: type[Record], identity: Mapping[str, str]) -> Record:
    """Return the dataclass written by ``save``, bit for bit; it must not contain others.

    Raises:
        UnusableFile: the file is damaged, or has another identity.
        EnvironmentFailure: the file cannot be read.
    """
    import numpy as np

    leaves = _read(path, identity)
    if {field.name for field in dataclasses.fields(record_class)} != leaves.keys():  # type: ignore[arg-type]
        raise UnusableFile(f"{path} was written by another version of conevo")
    for name, hint in get_type_hints(record_class).items():
        kinds = {float: (float, int)}.get(hint, (hint if isinstance(hint, type) else np.ndarray,))
        if type(leaves[name]) not in kinds:
            raise UnusableFile(f"{path} is damaged: {name} is {shown(leaves[name])}")
    return record_class(**leaves)


def load_like(example: Record, path: Path, identity: Mapping[str, str]) -> Record:
    """Return the dataclass written by ``save``, bit for bit, with the types of an example.

    Dimensions of arrays are not checked, see ``difference``. A mapping may have other names than
    the example's.

    Raises:
        UnusableFile: the file is damaged, or has another identity.
        EnvironmentFailure: the file cannot be read.
    """
    leaves = _read(path, identity)
    try:
        found: Record = _rebuilt(example, leaves, path)
    except KeyError as error:
        raise UnusableFile(f"{path} was written by another version of conevo") from error
    if leaves:
        raise UnusableFile(f"{path} was written by another version of conevo")
    return found


def _rebuilt(example: Any, leaves: dict[str, Any], path: Path, prefix: str = "") -> Any:
    """Return a dataclass like an example, and remove its values from ``leaves``."""
    values: dict[str, Any] = {}
    for field in _stored(example):
        name, like = f"{prefix}{field.name}", getattr(example, field.name)
        if dataclasses.is_dataclass(like):
            values[field.name] = _rebuilt(like, leaves, path, f"{name}.")
        elif isinstance(like, Mapping):
            keys = [key for key in leaves if key.startswith(f"{name}.")]
            values[field.name] = {key[len(name) + 1 :]: leaves.pop(key) for key in keys}
        else:
            values[field.name] = leaves.pop(name)
            if type(values[field.name]) is not type(_plain(like)):
                found = shown(values[field.name])
                raise UnusableFile(f"{path} is damaged: {name} is {found}")
    return type(example)(**values)


def difference(record: Any, example: Any) -> str:
    """Return the first field of a dataclass that has another type, or other dimensions.

    Args:
        record: as ``load_like`` returns it.
        example: passed to ``load_like``.

    Returns:
        The name of a field, empty if all are alike.
    """
    import numpy as np

    leaves = _leaves(record)
    for name, like in _leaves(example).items():
        found = leaves.get(name)
        if isinstance(like, np.ndarray) or isinstance(found, np.ndarray):
            kinds = [(a.dtype, a.ndim) if isinstance(a, np.ndarray) else () for a in (found, like)]
            if kinds[0] != kinds[1]:
                return name
        elif found is not None and type(found) is not type(like):
            return name
    return ""


def _read(path: Path, identity: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of the dataclass in a file, by name.

    Raises:
        UnusableFile: as ``load``.
        EnvironmentFailure: as ``load``.
    """
    from conevo.runs.records import FileText

    try:
        arrays = read_arrays(path, kind="a file of conevo", is_packed=False)
    except DamagedFile as error:
        raise UnusableFile(str(error)) from error
    try:
        about = json.loads(arrays.pop("about").tobytes())
        arrays = {name.removeprefix("field."): value for name, value in arrays.items()}
        is_whole = about.pop("digest") == _digest(about, arrays)
        check(about, FileText, "its text")
        version, found, fields = about["format"], about["identity"], about["fields"]
    except Exception as error:  # readers of damaged files raise anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnusableFile(f"{path} is damaged or not a file of conevo ({reason})") from error
    if not is_whole:
        raise UnusableFile(f"{path} is damaged (its digest does not match)")
    for key in {**identity, **found}:
        if found.get(key) != identity.get(key):
            raise UnusableFile(
                f"{path} is foreign: {key} is {found.get(key)!r}, not {identity.get(key)!r}"
            )
    if version != FORMAT or fields.keys() & arrays.keys():
        raise UnusableFile(f"{path} was written by another version of conevo")
    return {**fields, **arrays}


def content_digest(path: Path) -> str:
    """Return the digest of a file's content, which does not depend on the layout of the zip."""
    return str(json.loads(read_arrays(path)["about"].tobytes())["digest"])


def _digest(about: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    import numpy as np

    digest = hashlib.blake2b(json.dumps(about, sort_keys=True).encode(), digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
