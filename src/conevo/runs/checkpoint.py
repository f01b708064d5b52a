"""One flat dataclass in one file, whole or refused.

Arrays go into an uncompressed npz (never pickled), everything else as JSON beside them, with a
digest over all of it: a flipped bit anywhere is noticed, not only where zip's CRC looks. The file
says what it is (``identity``), so that another method's or another run's file is refused.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from conevo.errors import shown
from conevo.reading import DamagedFile, check, read_arrays
from conevo.runs.durable import replace_file

__all__ = ["UnusableFile", "content_digest", "load", "save"]

FORMAT = 1
Record = TypeVar("Record")


class UnusableFile(DamagedFile):
    """A checkpoint or team file that is corrupt, truncated or foreign."""


def save(path: Path, record: Any, identity: Mapping[str, str]) -> None:
    """Write a dataclass whose fields are arrays, ints, floats and strings.

    Args:
        path: the file; it is replaced at once.
        record: a dataclass instance.
        identity: what the file belongs to; ``load`` asks for the same.
    """
    import numpy as np

    fields = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    arrays = {name: value for name, value in fields.items() if isinstance(value, np.ndarray)}
    rest = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in fields.items()
        if name not in arrays
    }
    about = {"format": FORMAT, "identity": dict(identity), "fields": rest}
    about["digest"] = _digest(about, arrays)
    buffer = io.BytesIO()
    text = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    np.savez(buffer, allow_pickle=False, about=text, **{f"field.{k}": v for k, v in arrays.items()})
    replace_file(path, buffer.getvalue())


def load(path: Path, record_class: type[Record], identity: Mapping[str, str]) -> Record:
    """Return the dataclass written by ``save``, to the bit.

    Raises:
        UnusableFile: the file is damaged, or belongs to something else than ``identity``.
        EnvironmentFailure: the file cannot be read.
    """
    import numpy as np

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
    except Exception as error:  # whatever a damaged file makes its readers say
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UnusableFile(f"{path} is damaged or not a file of conevo ({reason})") from error
    if not is_whole:
        raise UnusableFile(f"{path} is damaged (its digest does not match)")
    for key in {**identity, **found}:
        if found.get(key) != identity.get(key):
            raise UnusableFile(
                f"{path} is foreign: {key} is {found.get(key)!r}, not {identity.get(key)!r}"
            )
    expected = {field.name for field in dataclasses.fields(record_class)}  # type: ignore[arg-type]
    if version != FORMAT or expected != fields.keys() | arrays.keys():
        raise UnusableFile(f"{path} was written by another version of conevo")
    for name, hint in get_type_hints(record_class).items():
        value = arrays.get(name, fields.get(name))
        kinds = {float: (float, int)}.get(hint, (hint if isinstance(hint, type) else np.ndarray,))
        if type(value) not in kinds:
            raise UnusableFile(f"{path} is damaged: {name} is {shown(value)}")
    return record_class(**fields, **arrays)


def content_digest(path: Path) -> str:
    """Return the digest that a whole file holds of its content, whichever way the zip was laid."""
    return str(json.loads(read_arrays(path)["about"].tobytes())["digest"])


def _digest(about: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    import numpy as np

    digest = hashlib.blake2b(json.dumps(about, sort_keys=True).encode(), digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
