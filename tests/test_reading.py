"""Reading files that may be damaged: complete, or one line that names the file."""

from __future__ import annotations

import io
import os
import socket
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from typing_extensions import TypedDict

from conevo.errors import EnvironmentFailure, UsageError, shown
from conevo.evolution.methods.outside import load as load_method
from conevo.outside import files_of
from conevo.reading import (
    DamagedFile,
    check,
    packed,
    read_arrays,
    read_bytes,
    read_json,
    read_json_lines,
    read_last_line,
    read_text,
    read_toml,
)
from conevo.worlds.outside import load as load_world
from conevo.worlds.pursuit.prey_sets import load as load_prey
from fuzz.damages import packed_zeros


def refused(read, path: Path, data: bytes) -> str:
    """Return the one line with which a file of this content is refused."""
    path.write_bytes(data)
    with pytest.raises(DamagedFile) as caught:
        read(path)
    line = str(caught.value)
    assert "\n" not in line
    assert str(path) in line
    assert len(line) < len(str(path)) + 300
    return line.replace(str(path), "FILE")


# --- regular files --------------------------------------------------------------------------------


def test_only_regular_files_are_opened_and_nothing_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "socket"))
        for path, words in (
            (tmp_path / "pipe", "it is a pipe, not a regular file"),
            (tmp_path / "link", "it is a pipe, not a regular file"),
            (tmp_path / "folder", "Is a directory"),
            (tmp_path / "socket", "it is a socket, not a regular file"),
            (Path("/dev/zero"), "it is a device, not a regular file"),
        ):
            for read in (read_bytes, read_text, read_json, read_json_lines, read_toml, read_arrays):
                with pytest.raises(DamagedFile) as caught:
                    read(path)
                assert str(caught.value) == f"cannot read {path}: {words}"


def test_refusals_of_the_system_are_faults_of_the_machine(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for path, words in (
        ("loop", "Too many levels"),
        ("a" * 300, "too lo"),
    ):
        with pytest.raises(EnvironmentFailure, match=f"cannot read .*: .*{words}"):
            read_bytes(tmp_path / path)
    for path, words in (("none", "No such file"), ("file/x", "Not a directory")):
        (tmp_path / "file").touch()
        with pytest.raises(UsageError, match=f"cannot read .*{path}: {words}"):
            read_bytes(tmp_path / path)
    with pytest.raises(UsageError, match=r"null (byte|character)"):
        read_bytes(tmp_path / "a\0b")


def test_own_files_and_prey_sets_that_the_system_refuses_are_faults_of_the_machine(
    tmp_path: Path,
) -> None:
    for read in (load_world, load_method, load_prey, files_of):
        with pytest.raises(EnvironmentFailure, match=r"cannot read .*: .*too lo"):
            read(tmp_path / f"{'a' * 300}.py")


def test_a_link_to_a_file_is_followed(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to("file")
    assert read_bytes(tmp_path / "link") == b"content"


def test_a_size_is_checked_before_memory_is_allocated(tmp_path: Path) -> None:
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(2**40)  # a sparse file: it takes no space on the disk
    for read in (read_bytes, read_text, read_json, read_json_lines, read_toml, read_arrays):
        with pytest.raises(DamagedFile, match="large is too large: more than"):
            read(path)


# --- text -----------------------------------------------------------------------------------------


def test_text_is_utf_8_with_or_without_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "text"
    for data in ("é = 1\n".encode(), "é = 1\n".encode("utf-8-sig")):
        path.write_bytes(data)
        assert read_text(path) == "é = 1\n"
    for encoding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32"):
        data = "a = 1\n".encode(encoding)
        for read in (read_text, read_toml, read_json):
            assert f"is {encoding[:6].upper()} text; save it as" in refused(read, path, data)
    assert "byte 4 is not UTF-8); save it as UTF-8" in refused(read_text, path, b"a = \xff")
    assert "null bytes" in refused(read_text, path, b"a = 1\0\n")


NESTED = b"[" * 50_000 + b"]" * 50_000
JSON = {
    b"": "Expecting value",
    b"[1]": "an object expected, not [1]",
    b"null": "an object expected, not None",
    NESTED: "nested too deeply",
    b'{"a": ' * 50_000: "nested too deeply",
    b'{"a": ' + b"[" * 40 + b"]" * 40 + b"}": "nested too deeply",
    b'{"a": NaN}': "NaN is not a finite number",
    b'{"a": -Infinity}': "-Infinity is not a finite number",
    b'{"a": 1e999}': "1e999 is not a finite number",
    b'{"a": ' + b"9" * 5000 + b"}": "999... is beyond 64 bits".replace("...", ""),
    b'{"a": 18446744073709551616}': "18446744073709551616 is beyond 64 bits",
    b'{"a": 1, "a": 2}': "'a' appears twice",
    b'{"a": 1}x': "Extra data",
}


@pytest.mark.parametrize("content", JSON, ids=[str(k) for k in range(len(JSON))])
def test_invalid_json_is_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    line = refused(read_json, path, content)
    assert line.startswith("FILE is damaged: ")
    assert JSON[content] in line
    line = refused(read_json_lines, path, b'{"a": 1}\n' + content + b"\n")
    assert line.startswith("FILE is damaged in line 2: ")


def test_json_keeps_its_values(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    text = '{"a": [1, 18446744073709551615, -0.5, true, null, "é"], "b": {"c": {}}}'
    path.write_text("\ufeff" + text)
    right = {"a": [1, 2**64 - 1, -0.5, True, None, "é"], "b": {"c": {}}}
    assert read_json(path) == right
    path.write_text(f"{text}\n{text}\n" + '{"torn": ')
    assert read_json_lines(path, is_log=True) == [right, right]
    with pytest.raises(DamagedFile, match="line 3 is incomplete"):
        read_json_lines(path)


TOML = {
    b"a = " + NESTED: "nested too deeply",
    b"a = " + b"{b = " * 50_000: "nested too deeply",
    b"a = " + b"[" * 40 + b"]" * 40: "nested too deeply",
    b"a = " + b"9" * 5000: "a number of more than 4300 digits",
    b"a = 1\na = 2": "Cannot overwrite",
    b"a =": "Invalid value",
}


@pytest.mark.parametrize("n", [0, 1, 100, 8190, 8191, 8192, 8193, 20_000])
def test_the_last_whole_line_is_found_without_reading_the_file(n: int, tmp_path: Path) -> None:
    path = tmp_path / "log"
    last = b"x" * n
    for before in (b"", b"first\n", b"y" * 50_000 + b"\n"):
        for torn in (b"", b"torn", b"z" * 9000):
            path.write_bytes(before + last + b"\n" + torn)
            assert read_last_line(path) == last
    path.write_bytes(b"torn")
    assert read_last_line(path) == b""
    path.write_bytes(b"")
    assert read_last_line(path) == b""
    assert "its last line has more than 100 bytes" in refused(
        lambda path: read_last_line(path, 100), path, b"a\n" + b"x" * 100 + b"\n"
    )


@pytest.mark.parametrize("content", TOML, ids=[str(k) for k in range(len(TOML))])
def test_invalid_toml_is_one_line(content: bytes, tmp_path: Path) -> None:
    line = refused(read_toml, tmp_path / "a.toml", content)
    assert line.startswith("FILE is not valid TOML: ")
    assert TOML[content] in line


def test_toml_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes("[run]\nseed = 3\n".encode("utf-8-sig"))
    assert read_toml(tmp_path / "a.toml") == {"run": {"seed": 3}}


# --- models ---------------------------------------------------------------------------------------


class Inner(TypedDict):
    """A part."""

    mean: float | None


class Outer(TypedDict):
    """A whole."""

    n: int
    parts: list[Inner]


def test_a_model_names_the_field_and_what_is_allowed(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text('{"n": 1, "parts": [{"mean": 2, "later": 1}], "more": []}')
    assert read_json(path, Outer)["more"] == []  # a later version's keys are left alone
    for content, words in (
        (b'{"n": 1}', "parts is missing"),
        (b'{"n": true, "parts": []}', "n = True: must be a valid integer"),
        (b'{"n": 1.0, "parts": []}', "n = 1.0: must be a valid integer"),
        (b'{"n": 1, "parts": [{"mean": "2"}]}', "parts[0].mean = '2': must be a valid number"),
        (b'{"n": 1, "parts": [[]]}', "parts[0] = []: must be a valid dictionary"),
    ):
        assert words in refused(lambda p: read_json(p, Outer), path, content)
    with pytest.raises(DamagedFile, match="here: n = nan: must be a finite number"):
        check({"n": float("nan")}, TypedDict("One", {"n": float}), "here")  # type: ignore[misc]


def test_values_are_shown_in_few_characters() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert shown("a") == "'a'"
    assert shown("a" * 100) == "'" + "a" * 56 + "..."
    assert shown(10**5000) == "a huge int"
    assert shown(deep) == "a huge list"


# --- arrays ---------------------------------------------------------------------------------------


def npz(**arrays: np.ndarray) -> bytes:
    """Return an npz file."""
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def member(shape: tuple[int, ...], descr: str = "|u1", content: bytes = b"") -> bytes:
    """Return an npz file whose only array has any given header."""
    head, out = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("a.npy", head.getvalue() + content)
    return out.getvalue()


def test_arrays_are_restored_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    rng = np.random.default_rng(1)
    arrays = {
        "a": rng.random((3, 4)),
        "b": np.asarray(rng.random((3, 4, 5), np.float32), order="F"),
        "c": rng.random(7) < 0.5,
        "d": np.array(3, np.uint64),
        "e": np.zeros((2, 0), np.int32),
    }
    for write in (np.savez, np.savez_compressed):
        write(path, **arrays)
        found = read_arrays(path)
        assert list(found) == list(arrays)
        for name, array in arrays.items():
            assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
            assert found[name].tobytes() == array.tobytes()
            assert found[name].flags.writeable
            assert found[name].flags.f_contiguous == array.flags.f_contiguous


ARRAYS = {
    b"": "not a zip file",
    b"PK\x05\x06" + bytes(18): None,
    npz(a=np.array([{}], dtype=object)): "an array of type object, not of numbers",
    npz(a=np.array(["text"])): "an array of type <U4, not of numbers",
    member((2**40,)): "an array whose size is not that of its header",
    member((-1, -4), content=b"abcd"): "an array whose size is not that of its header",
    member((2,), content=b"abcd"): "an array whose size is not that of its header",
    member((2,), "|b1", b"\x01\x02"): "truth values that are neither true nor false",
    member((2,), "|V1", b"ab"): "not of numbers",
    npz(a=np.zeros(1000))[:-300]: "not a zip file",
}


@pytest.mark.parametrize("content", ARRAYS, ids=[str(k) for k in range(len(ARRAYS))])
def test_invalid_archives_are_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    if ARRAYS[content] is None:  # an empty archive is valid
        path.write_bytes(content)
        assert read_arrays(path) == {}
    else:
        line = refused(read_arrays, path, content)
        assert line.startswith("FILE is damaged or not an npz file (")
        assert ARRAYS[content] in line


@pytest.mark.parametrize(
    ("declared", "words"),
    [(300 * 2**20, "unpacked it would have 314,572,800 bytes"), (100, "damaged or not an npz")],
)
def test_a_small_file_that_unpacks_to_a_large_one_costs_nothing(
    declared: int, words: str, tmp_path: Path
) -> None:
    path, data = tmp_path / "a.npz", packed_zeros(300 * 2**20, declared)
    assert len(data) < 2**20
    tracemalloc.start()
    try:
        assert words in refused(lambda p: read_arrays(p, 64 * 2**20), path, data)
        assert tracemalloc.get_traced_memory()[1] < 16 * 2**20
    finally:
        tracemalloc.stop()


def test_an_archive_that_is_never_compressed_unpacks_to_its_own_size(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, a=np.zeros(1000))
    assert read_arrays(path, is_packed=False)["a"].size == 1000
    np.savez_compressed(path, a=np.zeros(1000))
    with pytest.raises(DamagedFile, match="unpacked it would have 8,128 bytes, more than"):
        read_arrays(path, is_packed=False)


def test_a_repeated_or_differently_packed_member_is_refused(tmp_path: Path) -> None:
    path, out = tmp_path / "a.npz", io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("a.npy", b"")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("a.npy", b"")
    assert "it has two members of one name" in refused(read_arrays, path, out.getvalue())
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a.npy", b"")
    assert "not packed as numpy packs it" in refused(read_arrays, path, out.getvalue())


def test_long_dotted_keys_are_refused_before_they_take_memory(tmp_path: Path) -> None:
    path = tmp_path / "file.toml"
    for key in ("a." * 20000 + "a", "[" + "a." * 20000 + "a]\nb", '"a". ' * 20000 + "a"):
        path.write_text(f"{key} = 1\n")
        with pytest.raises(DamagedFile, match="nested too deeply"):
            read_toml(path)
    path.write_text(f'a.b.c = 1\nlong = "{"word" * 200_000}"\npath = "{"a/b.c/" * 1000}"\n')
    assert read_toml(path)["a"] == {"b": {"c": 1}}


@pytest.mark.parametrize("is_compressed", [False, True])
def test_an_interrupt_while_arrays_are_packed_stays_one(
    is_compressed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closing an archive while a member is being written is an error of zipfile."""

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("numpy.lib.format.write_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        packed("{}", {"one": np.zeros(3)}, is_compressed=is_compressed)


def test_packed_arrays_are_read_again(tmp_path: Path) -> None:
    (tmp_path / "one.npz").write_bytes(packed("text", {"one": np.arange(3.0)}))
    found = read_arrays(tmp_path / "one.npz")
    assert found["about"].tobytes() == b"text"
    assert found["one"].tolist() == [0, 1, 2]
