"""One team's part of a batch: views of arrays, and which of them lie in a block's shared memory.

On a CUDA device the lanes of a block share some memory that is far faster than the device's own.
The smallest arrays of a team are put there, as many as fit into a limit. These are the arrays that
an iteration uses again and again (places, actions, inputs, activations). A launch copies them from
the batch at its start and back at its end.

Choice: the limit is 24 KiB a block, so that nine blocks are on a multiprocessor of an H100 at once
and four on that of a smaller card. An array that does not fit stays where it is.
"""

from collections.abc import Mapping
from functools import cache
from math import prod
from typing import Any

import warp as wp

from conevo.kernels.phases import n_lanes, written

__all__ = ["SHARED_BYTES", "copy_of", "near_arrays", "view_of"]

SHARED_BYTES = 24 * 1024

Near = tuple[tuple[str, int], ...]


def near_arrays(
    structs: Mapping[Any, Mapping[str, tuple[int, ...]]], limit: int = SHARED_BYTES
) -> dict[Any, Near]:
    """Return which arrays of each struct lie in shared memory, with their numbers of elements.

    Args:
        structs: the shapes of one team's arrays.
        limit: bytes of shared memory.
    """
    sizes = []
    for struct, shape_of in structs.items():
        for name, shape in shape_of.items():
            size = prod(shape) * wp.types.type_size_in_bytes(struct.vars[name].type.dtype)
            sizes.append((-(-size // 16) * 16, struct, name))
    found: dict[Any, list[tuple[str, int]]] = {struct: [] for struct in structs}
    for size, struct, name in sorted(sizes, key=lambda one: (one[0], one[2])):
        limit -= size
        if limit < 0:
            break
        found[struct].append((name, prod(structs[struct][name])))
    return {struct: tuple(sorted(names)) for struct, names in found.items()}


@cache
def view_of(struct: Any, has_shared: bool = False, near: Near = ()) -> Any:
    """Return the function ``view(batch, index, n)`` that gives one of ``n`` parts of a batch.

    A batch is a struct whose arrays contain the parts one after another, along their first
    dimension. The view has the same fields, with each array cut down to its part. Numbers are
    shared by all parts.

    The function is written out, field by field, because contiguous arrays made from pointers are
    a quarter faster than slices (measured), and Warp has no loop over fields.

    Args:
        struct: its arrays have one or two dimensions.
        has_shared: whether all parts also share the arrays of more than one dimension.
        near: arrays that lie in shared memory on a CUDA device, with the elements of a part.
    """
    lines = ["def view(batch: Struct, index: int, n: int) -> Struct:", "    part = Struct()"]
    scope: dict[str, Any] = {"Struct": struct, "wp": wp}
    places = dict(near)
    for name, var in struct.vars.items():
        kind = var.type
        if wp.types.is_array(kind) and (kind.ndim == 1 or not has_shared):
            size = wp.types.type_size_in_bytes(kind.dtype)
            scope[f"{name}_type"] = kind.dtype
            wide = f" * batch.{name}.shape[1]" if kind.ndim == 2 else ""
            shape = f"{name}_size, batch.{name}.shape[1]" if wide else f"{name}_size,"
            pointer = f"batch.{name}.ptr + {name}_at"
            if name in places:
                scope[f"{name}_place"] = _place(struct, name, places[name] * size)
                pointer = f"{name}_place({pointer})"
            lines += [
                f"    {name}_size = batch.{name}.shape[0] // n",
                f"    {name}_at = wp.uint64(index) * wp.uint64({name}_size{wide} * {size})",
                f"    part.{name} = wp.array(",
                f"        ptr={pointer},",
                f"        shape=({shape}),",
                f"        dtype={name}_type,",
                "    )",
            ]
        else:
            lines += [f"    part.{name} = batch.{name}"]
    return written("view", [*lines, "    return part"], scope, f"view of {struct.key}")


@cache
def _place(struct: Any, name: str, size: int) -> Any:
    """Return the function that returns the address of an array in shared memory, not its own.

    On the CPU, where such kernels are only tested, one block at a time has this memory.
    """
    snippet = f"""
#if defined(__CUDA_ARCH__)
    __shared__ __align__(16) char near_{name}[{size}];
#else
    alignas(16) static char near_{name}[{size}];
#endif
    return (wp::uint64)near_{name};
"""
    key = f"place_{struct.key.rpartition('.')[2]}_{name}"
    lines = ["@wp.func_native(snippet)", f"def {key}(own: wp.uint64) -> wp.uint64: ..."]
    scope = {"wp": wp, "snippet": snippet}
    return written(key, lines, scope, f"{key} {size}", is_native=True)


@cache
def copy_of(struct: Any, near: Near) -> Any:
    """Return ``copy(of, to, lane)``, which copies the arrays that lie in shared memory."""
    lines = ["def copy(of: Struct, to: Struct, lane: int) -> None:", "    k = int(0)"]
    for name, size in near:
        at = f"k // to.{name}.shape[1], k % to.{name}.shape[1]"
        at = at if struct.vars[name].type.ndim == 2 else "k"
        lines += [
            "    k = lane",
            f"    while k < {size}:",
            f"        to.{name}[{at}] = of.{name}[{at}]",
            "        k += n_lanes()",
        ]
    scope: dict[str, Any] = {"Struct": struct, "n_lanes": n_lanes}
    return written("copy", lines, scope, f"copy of {struct.key}")
