"""Kinds of damage to files: seeded, so that each can be repeated from its number."""

from __future__ import annotations

import io
import json
import os
import random
import socket
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from conevo.runs.checkpoint import _digest

NESTED = b"[" * 50_000 + b"]" * 50_000
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 2**63, 2**70, 10**400, 0.5, -0.0, 1e300, "", "x" * 300, "\0", "../../etc",
    [], [1], [[]], {}, {"a": 1}, "nan",
)  # fmt: skip
TEXTS = ("-1", "0", "1e400", "nan", "inf", '""', '"x"', "[]", "[[]]", "{}", "true", "9" * 30, "1.5")


def damage(path: Path, rng: random.Random, others: list[Path]) -> str:
    """Damage a file in one of many ways and return what was done."""
    kinds: list[Callable[[Path, random.Random], str]] = [*ANY]
    if path.suffix in (".json", ".jsonl") or path.name == "DONE":
        kinds += [mutate_json] * 12
    if path.suffix == ".toml":
        kinds += [mutate_toml] * 12
    if path.suffix == ".npz":
        kinds += [mutate_arrays] * 8 + [bomb, swap_members]
    if path.suffix == ".py":
        kinds += [mutate_toml] * 4
    if rng.random() < 0.06:
        other = rng.choice(others)
        content = other.read_bytes()
        path.write_bytes(content)
        return f"replaced by {other.name}"
    return rng.choice(kinds)(path, rng)


# --- any file -------------------------------------------------------------------------------------


def flip(path: Path, rng: random.Random) -> str:
    """Flip one to eight bits."""
    data = bytearray(path.read_bytes()) or bytearray(b"\0")
    for _ in range(rng.choice((1, 1, 1, 8))):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)
    return "bits flipped"


def cut(path: Path, rng: random.Random) -> str:
    """Cut off the end."""
    data = path.read_bytes()
    path.write_bytes(data[: rng.randrange(len(data) + 1)])
    return "cut"


def content(path: Path, rng: random.Random) -> str:
    """Replace the content."""
    found = rng.choice((
        b"", b"\n", b"{}", b"[]", b"null", b"3", b'"x"', b"\0" * 100, b"{" , NESTED,
        b'{"a": ' * 50_000, b"a = " + NESTED, b"{}\n" * 3, rng.randbytes(300), b"9" * 5000,
        path.read_bytes().decode("utf-8", "replace").encode("utf-16"),
        path.read_bytes() * 2, b"\xef\xbb\xbf" + path.read_bytes(), b"PK\x05\x06" + bytes(18),
    ))  # fmt: skip
    path.write_bytes(found)
    return f"content {found[:20]!r}"


def place(path: Path, rng: random.Random) -> str:
    """Replace it with something that is not a file."""
    how = rng.choice(("none", "folder", "pipe", "device", "dangling", "loop", "socket", "hole"))
    path.unlink()
    if how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how == "device":
        path.symlink_to("/dev/zero")
    elif how == "dangling":
        path.symlink_to("nowhere")
    elif how == "loop":
        path.symlink_to(path.name)
    elif how == "socket" and len(str(path)) < 100:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(str(path))
    elif how == "hole":
        with path.open("wb") as file:
            file.truncate(2**41)
    return f"in its place: {how}"


ANY = (flip, flip, cut, content, content, place)


# --- text -----------------------------------------------------------------------------------------


def mutate_json(path: Path, rng: random.Random) -> str:
    """Change one key or value somewhere in a JSON file, or in a line of one."""
    lines = path.read_text().splitlines() if path.suffix == ".jsonl" else [path.read_text()]
    at = rng.randrange(len(lines)) if lines else 0
    try:
        found = json.loads(lines[at])
    except (ValueError, IndexError):
        return flip(path, rng)
    holders = [found]
    for one in holders:
        inner = one.values() if isinstance(one, dict) else one
        holders += [value for value in inner if isinstance(value, dict | list) and value]
    holder = rng.choice(holders)
    key = rng.choice(list(holder)) if isinstance(holder, dict) else rng.randrange(len(holder))
    how = rng.choice(("value", "value", "value", "drop", "rename"))
    before = holder[key]
    if how == "value" or (how == "rename" and isinstance(holder, list)):
        holder[key] = rng.choice(VALUES)
        done = f"{key} = {str(holder[key])[:30]}"
    elif how == "drop":
        del holder[key]
        done = f"{key} dropped"
    else:
        letter = rng.randrange(len(key)) if key else 0
        del holder[key]
        holder[f"{key[:letter]}q{key[letter + 1 :]}"] = before
        done = f"{key} renamed"
    lines[at] = json.dumps(found)
    path.write_text("\n".join(lines) + "\n")
    return done


def mutate_toml(path: Path, rng: random.Random) -> str:
    """Remove, repeat or change a line."""
    lines = path.read_text().splitlines()
    at = rng.randrange(len(lines))
    how = rng.choice(("drop", "double", "value", "value", "value", "rename"))
    if how == "drop":
        del lines[at]
    elif how == "double":
        lines.insert(at, lines[at])
    elif how == "rename" and lines[at]:
        letter = rng.randrange(len(lines[at]))
        lines[at] = f"{lines[at][:letter]}q{lines[at][letter + 1 :]}"
    else:
        lines[at] = f"{lines[at].partition('=')[0]}= {rng.choice(TEXTS)}"
    path.write_text("\n".join(lines) + "\n")
    return f"line {at + 1}: {lines[at][:60] if at < len(lines) else ''!r} ({how})"


# --- archives -------------------------------------------------------------------------------------


def mutate_arrays(path: Path, rng: random.Random) -> str:
    """Change an array's shape, type or values, or the text next to it; the digest is right."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    about = json.loads(arrays.pop("about").tobytes())
    name = rng.choice(list(arrays))
    array = arrays[name]
    how = rng.choice(
        ("shape", "shape", "type", "values", "empty", "drop", "more", "about", "about")
    )
    if how == "shape":
        arrays[name] = array.reshape(-1) if rng.random() < 0.5 else array[..., None]
    elif how == "type":
        kind = rng.choice((np.float64, np.int64, np.uint8, np.bool_, np.complex128, ">f4"))
        with np.errstate(invalid="ignore"):
            arrays[name] = np.nan_to_num(array).astype(kind)
    elif how == "values":
        fill = rng.choice((float("nan"), 1e300, -1, 2**40))
        with np.errstate(all="ignore"):
            arrays[name] = np.full(array.shape, fill).astype(array.dtype)
    elif how == "empty":
        arrays[name] = array[:0]
    elif how == "drop":
        del arrays[name]
    elif how == "more":
        arrays["extra"] = array
    else:
        key = rng.choice([key for key in about if key != "digest"])
        about[key] = rng.choice(VALUES)
        how = f"about.{key} = {str(about[key])[:30]}"
    if "digest" in about:
        del about["digest"]
        plain = {key.removeprefix("field."): value for key, value in arrays.items()}
        about["digest"] = _digest(about, plain)
    out = io.BytesIO()
    np.savez(out, about=np.frombuffer(json.dumps(about).encode(), np.uint8), **arrays)
    path.write_bytes(out.getvalue())
    return f"{name}: {how}"


def packed_zeros(size: int, says: int) -> bytes:
    """Return a small npz file that unpacks to very many zeros, whatever its records say."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH)  # can be repeated
    packed = piece * (size // 2**20) + b"\x03\x00"
    name, sizes = b"a.npy", struct.pack("<III", 0, len(packed), says)
    local = b"PK\x03\x04" + struct.pack("<5H", 20, 0, 8, 0, 33) + sizes
    local += struct.pack("<HH", len(name), 0) + name + packed
    central = b"PK\x01\x02" + struct.pack("<6H", 20, 20, 0, 8, 0, 33) + sizes
    central += struct.pack("<HHHHHII", len(name), 0, 0, 0, 0, 0, 0) + name
    end = b"PK\x05\x06" + struct.pack("<4HIIH", 0, 0, 1, 1, len(central), len(local), 0)
    return local + central + end


def bomb(path: Path, rng: random.Random) -> str:
    """Make it unpack to three GB."""
    path.write_bytes(packed_zeros(3 * 2**30, rng.choice((3 * 2**30, 100))))
    return "a bomb"


def swap_members(path: Path, rng: random.Random) -> str:
    """Write the members twice, or without the text."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    if rng.random() < 0.5:
        members.pop("about.npy", None)
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name.upper() if rng.random() < 0.2 else name, data)
    return "members changed"
