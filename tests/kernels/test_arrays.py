"""Structs whose arrays name their dimensions."""

from typing import Annotated

import warp as wp

from conevo.kernels.arrays import allocate, dimensions, named_arrays, shapes


@named_arrays
class Shelf:
    """Arrays with and without names, and a number."""

    plain: wp.array[float]
    books: Annotated[wp.array[int], "shelves", "books"]
    pages: Annotated[wp.array2d[float], "shelves", "books", "pages"]
    n: int


def test_names_sizes_and_arrays() -> None:
    names = dimensions(Shelf, lambda _: ("shelves",))
    assert names == {
        "plain": ("shelves",),
        "books": ("shelves", "books"),
        "pages": ("shelves", "books", "pages"),
    }
    shape_of = shapes(names, {"shelves": 2, "books": 3, "pages": 5})
    assert shape_of == {"plain": (2,), "books": (2, 3), "pages": (2, 3, 5)}
    made = allocate(Shelf, shape_of, 4, "cpu")
    assert made.plain.shape == (8,)
    assert made.books.shape == (24,)
    assert made.books.dtype == wp.int32
    assert made.pages.shape == (24, 5)


def test_a_plain_struct_has_only_the_default() -> None:
    @wp.struct
    class Plain:
        """One array."""

        x: wp.array[float]

    assert dimensions(Plain, lambda name: (name,)) == {"x": ("x",)}
