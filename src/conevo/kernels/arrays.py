"""Structs of arrays that name their dimensions; allocation and recording follow from the names.

An array of such a struct contains the parts of a batch (teams, say) one after another along its
first dimension. In the kernel it has one dimension, or two if its last one is kept separate
(``wp.array2d``).
"""

from collections.abc import Callable, Mapping
from math import prod
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy.typing as npt
import warp as wp

__all__ = ["allocate", "dimensions", "first_parts", "named_arrays", "shapes"]

Names = tuple[str, ...]


def named_arrays(kind: type) -> Any:
    """Make a class a Warp struct; ``x: Annotated[wp.array[float], "robots"]`` names dimensions.

    Use this decorator in place of ``wp.struct`` if an array has other dimensions than the default
    ones.
    """
    hints = get_type_hints(kind, include_extras=True)
    named = {name: get_args(hint)[1:] for name, hint in hints.items() if _is_named(hint)}
    kind.__annotations__ = {n: get_args(h)[0] if n in named else h for n, h in hints.items()}
    struct = wp.struct(kind)
    struct.dimensions = named
    return struct


def _is_named(hint: Any) -> bool:
    return get_origin(hint) is Annotated


def dimensions(struct: Any, default: Callable[[str], Names]) -> dict[str, Names]:
    """Return the names of the dimensions of every array of a struct.

    Args:
        struct: a Warp struct.
        default: returns the dimensions of an array that names none, given the array's name.
    """
    named = getattr(struct, "dimensions", {})
    arrays = [name for name, var in struct.vars.items() if wp.types.is_array(var.type)]
    return {name: named.get(name) or default(name) for name in arrays}


def shapes(names: Mapping[str, Names], sizes: Mapping[str, int]) -> dict[str, tuple[int, ...]]:
    """Return the shape of every array, given the sizes of the dimensions."""
    return {array: tuple(sizes[name] for name in those) for array, those in names.items()}


def allocate(struct: Any, shape_of: Mapping[str, tuple[int, ...]], n: int, device: str) -> Any:
    """Return a struct with arrays of zeros for ``n`` parts of these shapes."""
    made = struct()
    for name, shape in shape_of.items():
        kind = struct.vars[name].type
        apart = shape[len(shape) - kind.ndim + 1 :]
        size = n * prod(shape[: len(shape) - len(apart)])
        setattr(made, name, wp.zeros((size, *apart), dtype=kind.dtype, device=device))
    return made


def first_parts(array: Any, n: int, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    """Return a copy of the first ``n`` parts of a batch, each of a shape."""
    values: npt.NDArray[Any]
    if array.device.is_cpu:
        values = array.numpy().reshape(-1, *shape)[:n].copy()
    else:  # cut on the device, so that only these parts are fetched
        values = array[: n * prod(shape) // prod(array.shape[1:])].numpy().reshape(n, *shape)
    return values
