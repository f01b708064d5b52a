"""The source that Warp generates calls nothing that differs between targets.

A library's sine, exponential or power differs between a CPU and a GPU, and between versions of
either. All other operations are exact or rounded correctly everywhere, so results are equal bit
for bit.
"""

import re
from pathlib import Path

import pytest
import warp as wp

from conevo.controllers.registry import CONTROLLERS, controller
from conevo.kernels import engine
from conevo.kernels.random import uniform
from conevo.worlds.episode import episode_kernel, loading_kernel
from conevo.worlds.registry import WORLDS, world

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TASKS = (
    *(f"{entry.name}/{entry.environments[0]}" for entry in WORLDS.values()),
    f"{EXAMPLES}/light.py:dark-1",
    f"{EXAMPLES}/ball.py:far-1",
)
CPU, CUDA = "cpu", "cuda"

ALLOWED = """
    add sub mul div neg sqrt cw_mul dot length
    abs min max clamp floor ceil mod floordiv where isnan
    float int float32 int32 int64 uint8 uint64
    bit_and bit_or bit_xor invert lshift rshift bit_count unot
    address load array_store assign assign_inplace copy extract array_t vec_t tuple
    range iter_cmp iter_next builtin_tid1d builtin_tid2d builtin_block_dim
    WP_TILE_SYNC
"""  # rounded correctly, in a fixed order; exact; memory, loops, indices
ATOMIC = re.compile(r"\batomic_(?:add|min|max|or|and)\(([^;]*), (\w+)\);")  # exact for integers
FRAME = """
    if for while switch return defined sizeof static_cast constexpr
    WP_CLUSTER_DIMS WP_MAXNREG WP_ENABLE_SMEM_SPILLING init wp_cpu_run_block
"""  # of the language, and of the launch around a kernel

CALL = re.compile(r"(?<![\w.])(\w+)\s*(?:<[\w:<>, ]*>)?\s*\(")
DEFINED = re.compile(r"^(?:static|extern|template|WP_API|void)\b[^\n(;=]*?\b(\w+)\(", re.M)


def source_of(kernel, target):
    """Return the source that Warp would compile for a kernel."""
    engine.start()
    with engine.building:
        kernel.module.get_module_hash(1)
        options = kernel.module.resolve_options(wp.config, block_dim=1)
        options |= {"output_arch": None if target == CPU else 90}
        return kernel.module._run_codegen(options, target == CPU)[0]


def is_integer(name, before):
    """Return whether the last declaration of a variable before its use is as an integer."""
    kinds = re.findall(rf"\bwp::(\w+)&? {name}\b", before)
    return bool(kinds) and re.fullmatch(r"u?int(32|64)", kinds[-1]) is not None


def foreign_calls(source):
    """Return the names that a generated source calls, but neither defines nor may call.

    Adjoints, which Warp writes for some structs, are never run.
    """
    code = re.sub(r"//[^\n]*|^ *#(?:\\\n|[^\n])*", "", source, flags=re.M)
    for call in ATOMIC.finditer(code):
        if is_integer(call[2], code[: call.start()]):
            code = code.replace(call[0], ";" * len(call[0]))
    known = {*DEFINED.findall(code), *re.findall(r"\bstruct (\w+)", code)}
    known |= {*ALLOWED.split(), *FRAME.split()}
    return {name for name in CALL.findall(code) if not name.startswith("adj_")} - known


def kernels_of(task, mind):
    shape = mind.mind(len(task.inputs), len(task.outputs))
    return (
        episode_kernel(task.simulation(), shape),
        loading_kernel(shape),
    )


@pytest.mark.parametrize("target", [CPU, CUDA])
@pytest.mark.parametrize("path", TASKS, ids=lambda path: path.rpartition("examples/")[2])
def test_worlds_call_no_library_mathematics(path, target):
    task = world(path)
    for kernel in kernels_of(task, controller(world=task)):
        assert foreign_calls(source_of(kernel, target)) == set()


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_call_no_library_mathematics(name):
    task = world(TASKS[-1])
    for kernel in kernels_of(task, controller(name, world=task)):
        assert foreign_calls(source_of(kernel, CUDA)) == set()


@wp.func
def through_a_function(a: float) -> float:
    return wp.sin(a) * wp.sqrt(a)


@wp.func_native("return sinf(a);")
def by_native_code(a: float) -> float: ...


@wp.kernel(module="unique", module_options=engine.options)
def called(a: wp.array[float]):
    a[wp.tid()] = wp.cos(wp.abs(a[0]))


@wp.kernel(module="unique", module_options=engine.options)
def deeply(a: wp.array[float]):
    a[wp.tid()] = through_a_function(a[0])


@wp.kernel(module="unique", module_options=engine.options)
def natively(a: wp.array[float]):
    a[wp.tid()] = by_native_code(a[0])


@wp.kernel(module="unique", module_options=engine.options)
def by_an_operator(a: wp.array[float]):
    a[wp.tid()] = a[0] ** 1.5


@wp.kernel(module="unique", module_options=engine.options)
def in_an_order_of_threads(a: wp.array[float]):
    wp.atomic_add(a, 0, 0.1)


@wp.kernel(module="unique", module_options=engine.options)
def counting(a: wp.array[int], b: wp.array[wp.uint64]):
    k = wp.atomic_add(a, 0, 1)
    wp.atomic_min(a, 1, k)
    wp.atomic_or(b, 0, wp.uint64(k))


@wp.kernel(module="unique", module_options=engine.options)
def exactly(a: wp.array[float], seed: wp.uint64):  # and not sin(a) in a comment
    k = wp.tid()
    if wp.max(a[k], 0.0) > 0.5:
        a[k] = wp.floor(a[k]) / 3.0 - uniform(seed, k, 0, 0) * wp.vec2f(a[k], 1.0)[0]


@pytest.mark.parametrize("target", [CPU, CUDA])
@pytest.mark.parametrize(
    ("kernel", "found"),
    [
        (called, {"cos"}),
        (deeply, {"sin"}),
        (natively, {"sinf"}),
        (by_an_operator, {"pow"}),
        (in_an_order_of_threads, {"atomic_add"}),
        (counting, set()),
        (exactly, set()),
    ],
    ids=lambda value: getattr(value, "key", ""),
)
def test_a_call_of_library_mathematics_is_found(kernel, found, target):
    assert foreign_calls(source_of(kernel, target)) == found


def test_no_multiplication_and_addition_are_fused_into_one():
    options = called.module.resolve_options(wp.config)
    assert (options["fuse_fp"], options["fast_math"]) == (False, False)
