"""A checkpoint is restored bit for bit, or refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from conevo.errors import UsageError
from conevo.runs.checkpoint import UnusableFile, difference, load, load_like, save

IDENTITY = {"run_id": "abc", "method": "cone"}


@dataclass(frozen=True)
class Example:
    generation: int
    phase: str
    sst: float
    gst: float
    genes: npt.NDArray[np.float32]
    active: npt.NDArray[np.bool_]
    scores: npt.NDArray[np.float64]
    empty: npt.NDArray[np.int32]


@dataclass(frozen=True)
class Newer:
    generation: int
    genes: npt.NDArray[np.float32]


def example() -> Example:
    rng = np.random.default_rng(3)
    return Example(
        generation=7,
        phase="genotypes",
        sst=0.1 + 0.2,
        gst=float("nan"),
        genes=rng.standard_normal((2, 3, 5), dtype=np.float32),
        active=rng.random((2, 3)) < 0.5,
        scores=np.array([np.nan, np.inf, -0.0, 1 / 3]),
        empty=np.zeros((2, 0), dtype=np.int32),
    )


def is_same(a: Any, b: Any) -> bool:
    for field in fields(a):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if isinstance(x, np.ndarray):
            if (x.dtype, x.shape, x.tobytes()) != (y.dtype, y.shape, y.tobytes()):
                return False
        elif repr(x) != repr(y) or type(x) is not type(y):
            return False
    return True


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "checkpoint.npz"
    save(path, example(), IDENTITY)
    return path


def test_everything_is_restored_bit_for_bit(saved: Path) -> None:
    assert is_same(load(saved, Example, IDENTITY), example())


def test_numpy_scalars_are_stored_as_plain_numbers(tmp_path: Path) -> None:
    @dataclass(frozen=True)
    class Scalars:
        n: int
        x: float

    path = tmp_path / "s.npz"
    save(path, Scalars(np.int64(3), np.float64(0.1)), IDENTITY)  # type: ignore[arg-type]
    assert load(path, Scalars, IDENTITY) == Scalars(3, 0.1)


def test_any_flipped_bit_is_noticed_or_harmless(saved: Path) -> None:
    """One random bit of every byte: the same content, or a refusal."""
    data, rng = saved.read_bytes(), np.random.default_rng(1)
    refusals: list[str] = []
    for position in range(len(data)):
        damaged = bytearray(data)
        damaged[position] ^= 1 << int(rng.integers(8))
        saved.write_bytes(damaged)
        try:
            assert is_same(load(saved, Example, IDENTITY), example()), position
        except UnusableFile as error:
            refusals.append(str(error))
    assert len(refusals) > len(data) // 3  # the others are in zip's own records, such as dates
    assert all(str(saved) in line and "\n" not in line for line in refusals)


def test_any_truncation_is_noticed(saved: Path) -> None:
    data = saved.read_bytes()
    for length in range(0, len(data), 7):
        saved.write_bytes(data[:length])
        with pytest.raises(UnusableFile, match="damaged"):
            load(saved, Example, IDENTITY)


def test_another_runs_or_methods_file_is_refused(saved: Path) -> None:
    with pytest.raises(UnusableFile, match="method is 'cone', not 'mesp'"):
        load(saved, Example, IDENTITY | {"method": "mesp"})
    with pytest.raises(UnusableFile, match="run_id is 'abc', not 'xyz'"):
        load(saved, Example, IDENTITY | {"run_id": "xyz"})


def test_other_files_are_refused(saved: Path) -> None:
    with saved.open("wb") as file:
        np.savez(file, a=np.zeros(3))
    with pytest.raises(UnusableFile, match="damaged or not a file of conevo"):
        load(saved, Example, IDENTITY)
    saved.write_text("hello")
    with pytest.raises(UnusableFile, match="damaged or not a file of conevo"):
        load(saved, Example, IDENTITY)


def test_pickles_are_not_opened(saved: Path) -> None:
    with saved.open("wb") as file:
        np.savez(file, about=np.array([{"x": 1}], dtype=object))
    with pytest.raises(UnusableFile, match="damaged or not a file of conevo"):
        load(saved, Example, IDENTITY)


def test_another_versions_fields_are_refused(saved: Path) -> None:
    with pytest.raises(UnusableFile, match="another version of conevo"):
        load(saved, Newer, IDENTITY)


@dataclass(frozen=True)
class Inner:
    root: int
    fitness: npt.NDArray[np.float64]
    numbers: Mapping[str, float]


@dataclass(frozen=True)
class Outer:
    inner: Inner
    is_open: bool
    step: float
    mean: npt.NDArray[np.float64]
    any: Any = None


def outer(**changes: Any) -> Outer:
    inner = Inner(3, np.array([np.nan, 1 / 3]), {"sst": float("nan"), "a.b": 2})
    return replace(Outer(inner, True, 0.1 + 0.2, np.array([1e-320]), "x"), **changes)


def test_dataclasses_within_dataclasses_are_restored_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "outer.npz"
    save(path, outer(), IDENTITY)
    with np.load(path) as archive:
        assert set(archive) == {"about", "field.mean", "field.inner.fitness"}
    like = outer(inner=Inner(0, np.zeros(2), {}), mean=np.zeros(1), step=0.0)
    found = load_like(like, path, IDENTITY)
    assert type(found) is Outer
    assert is_same(found.inner, outer().inner)
    assert is_same(replace(found, inner=None), replace(outer(), inner=None))
    assert difference(found, like) == ""
    assert difference(found, outer(mean=np.zeros((1, 1)))) == "mean"
    assert difference(found, outer(inner=Inner(0, np.zeros(2, np.float32), {}))) == "inner.fitness"


def test_values_of_another_kind_than_the_examples_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "outer.npz"
    save(path, outer(), IDENTITY)
    for like, words in (
        (outer(step=1), r"damaged: step is 0\.3"),
        (outer(is_open=1), "damaged: is_open is True"),
        (outer(mean=1.0), "damaged: mean is"),
        (outer(mean={}), "another version"),
        (outer(inner=Newer(1, np.zeros(1))), "another version"),
        (example(), "another version"),
    ):
        with pytest.raises(UnusableFile, match=words) as caught:
            load_like(like, path, IDENTITY)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "what"),
    [
        (np.random.default_rng(1), "Generator"),
        ([1, 2], "list"),
        (None, "NoneType"),
        ({1: 2.0}, "dict"),
        (np.array([{}], dtype=object), "an array of objects"),
        (np.ma.masked_array([1.0], [True]), "MaskedArray"),
    ],
)
def test_a_field_that_cannot_be_kept_is_named(value: Any, what: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=f"the state of Outer cannot be kept: any is {what};"):
        save(tmp_path / "outer.npz", outer(any=value), IDENTITY)
    assert list(tmp_path.iterdir()) == []
