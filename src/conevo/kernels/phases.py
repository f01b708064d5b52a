"""Phases: the steps of a team's iteration, each a loop over items.

The lanes of a block share the items of a phase and wait for each other after it. A single lane does
all items in order. Results do not depend on the number of lanes, bit for bit, if no item reads data
that another item of the same phase writes, and if sums over items are integers.
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
        items: the number of items, or ``items(team, scene, p)``, which returns it; by default one
            item for each robot. This function must not read data that an item writes.
        takes: the function's arguments after team, scene and p.
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
    """Wait for all lanes of the block; with one lane there is nothing to wait for."""


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
        arguments: names and types of the arguments that all phases have, such as team, scene and p.
        first: number of the first phase, the index in ``clock`` at which its cycles are added up;
            None for no timing.
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
    """Return a Warp function that runs phases with robots visited in a given order.

    Its arguments are those of the phases' functions, then ``order`` [B, R], ``b`` and ``t``: robots
    in row b, -1 for none. Items that are not robots are visited in reverse if the order differs
    from that of the robots' numbers.
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
    """Return the Warp function of a source text, which Warp reads again when it compiles it.

    Args:
        name: of the function.
        lines: of the text.
        scope: the objects that its names refer to.
        title: of the text, for messages.
        is_native: whether it is decorated with ``wp.func_native``, which must be part of the text.
    """
    source = "\n".join([*lines, ""])
    digest = hashlib.blake2b(source.encode(), digest_size=4).hexdigest()
    file = f"<{title} {digest}>"  # one name, one text
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), scope)
    return scope[name] if is_native else wp.func(scope[name])
