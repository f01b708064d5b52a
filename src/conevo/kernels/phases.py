"""Phases: what a team does one after another in an iteration, each a loop over items.

The lanes of a block share the items of a phase and wait for each other after it. One lane does all
items in their order. Whatever the lanes, the bits are the same if no item reads what another item
of the same phase writes, and sums over items are integers.
"""

import hashlib
import linecache
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import warp as wp

__all__ = ["Phase", "barrier", "cycles", "n_lanes", "run_of", "walk_of", "written"]


@dataclass(frozen=True)
class Phase:
    """One loop over items.

    Attributes:
        function: ``function(team, scene, p, q, t)`` does item q in iteration t.
        items: ``items(team, scene, p)`` tells how many there are, or their number; by default one
            for each robot. No item writes what it reads.
        takes: what the function is given after team, scene and p.
    """

    function: Any
    items: Any = None
    takes: str = "q, t"

    @property
    def name(self) -> str:
        """The name of the function."""
        return str(self.function.key.rpartition(".")[2])


@wp.func_native("WP_TILE_SYNC();")
def barrier():  # type: ignore[no-untyped-def]
    """Wait for all lanes of the block (nothing to wait for where a block has one lane)."""


@wp.func_native("return WP_TILE_BLOCK_DIM;")
def n_lanes() -> int:  # type: ignore[empty-body]
    """Return the lanes of a block, which are known when a kernel is compiled."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return (wp::int64)clock64();
#else
    return (wp::int64)__builtin_readcyclecounter();
#endif
""")
def cycles() -> wp.int64:
    """Return the processor's count of cycles."""


def run_of(
    name: str,
    phases: Sequence[Phase],
    arguments: Mapping[str, Any],
    first: int | None = None,
) -> Any:
    """Return a Warp function that runs phases one after another.

    Its arguments are those of the phases' functions, then ``robots``, ``lane``, ``t`` and
    ``clock``. It is written out as text, since Warp has no loop over functions.

    Args:
        name: of the function.
        phases: in their order.
        arguments: names and types of what every phase is given, as team, scene and p.
        first: number of the first phase, where the cycles that it takes are added up in ``clock``;
            None if nobody wants to know.
    """
    scope = {f"Type_{one}": kind for one, kind in arguments.items()}
    scope |= {"wp": wp, "n_lanes": n_lanes, "barrier": barrier, "cycles": cycles}
    given = ", ".join(arguments)
    lines = [
        f"def {name}({', '.join(f'{one}: Type_{one}' for one in arguments)},",
        "    robots: int, lane: int, t: int, clock: wp.array[wp.int64]) -> None:",
        "    q = int(0)",
        *([] if first is None else ["    since = cycles()", "    now = since"]),
    ]
    for k, phase in enumerate(phases):
        scope |= {f"phase_{k}": phase.function, f"items_{k}": phase.items}
        items = f"items_{k}({given})" if isinstance(phase.items, wp.Function) else phase.items
        lines += [
            f"    n_{k} = {'robots' if items is None else items}",
            f"    if n_{k} > 0:",
            "        q = lane",
            f"        while q < n_{k}:",
            f"            phase_{k}({given}, {phase.takes})",
            "            q += n_lanes()",
            "        barrier()",
        ]
        if first is not None:
            lines += [
                "    now = cycles()",
                "    if lane == 0:",
                f"        wp.atomic_add(clock, {first + k}, now - since)",
                "    since = now",
            ]
    types = ", ".join(getattr(kind, "key", str(kind)) for kind in arguments.values())
    return written(name, lines, scope, f"{name} of {types} from {first}")


def walk_of(name: str, phases: Sequence[Phase], arguments: Mapping[str, Any]) -> Any:
    """Return a Warp function that runs phases with robots visited in an order that is given.

    Its arguments are those of the phases' functions, then ``order`` [B, R], ``b`` and ``t``: robots
    in row b, -1 for none. Items that are not robots are visited last first if the order is not
    that of the robots' numbers.
    """
    scope = {f"Type_{one}": kind for one, kind in arguments.items()} | {"wp": wp}
    given = ", ".join(arguments)
    lines = [
        f"def {name}({', '.join(f'{one}: Type_{one}' for one in arguments)},",
        "    order: wp.array2d[int], b: int, t: int) -> None:",
        "    q = int(0)",
    ]
    for k, phase in enumerate(phases):
        scope |= {f"phase_{k}": phase.function, f"items_{k}": phase.items}
        call = f"phase_{k}({given}, {phase.takes})"
        if phase.items is None:
            lines += [
                "    for j in range(order.shape[1]):",
                "        q = order[b, j]",
                "        if q >= 0:",
                f"            {call}",
            ]
            continue
        items = f"items_{k}({given})" if isinstance(phase.items, wp.Function) else phase.items
        lines += [
            f"    n_{k} = int({items})",
            f"    for j in range(n_{k}):",
            f"        q = wp.where(order[b, 0] > 0, n_{k} - 1 - j, j)",
            f"        {call}",
        ]
    types = ", ".join(getattr(kind, "key", str(kind)) for kind in arguments.values())
    return written(name, lines, scope, f"{name} of {types}")


def written(
    name: str, lines: Sequence[str], scope: dict[str, Any], title: str, is_native: bool = False
) -> Any:
    """Return the Warp function of a text, which Warp reads again when it compiles it.

    Args:
        name: of the function.
        lines: of the text.
        scope: what its names stand for.
        title: of the text, as in messages.
        is_native: whether it is decorated with ``wp.func_native``, which must stand in the text.
    """
    source = "\n".join([*lines, ""])
    digest = hashlib.blake2b(source.encode(), digest_size=4).hexdigest()
    file = f"<{title} {digest}>"  # one name, one text
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), scope)
    return scope[name] if is_native else wp.func(scope[name])
