"""Kernel building blocks against their slow, obvious versions."""

import math

import numpy as np
import pytest
import warp as wp
from hypothesis import given, settings
from hypothesis import strategies as st

from conevo.controllers.srn import Srn, SrnMemory, SrnShape, SrnWeights, clear, load, think
from conevo.kernels import engine
from conevo.kernels.arrays import allocate, dimensions, shapes
from conevo.kernels.geometry import COVER_WORDS, cover_disc, covered_by_any, octant
from conevo.kernels.outputs import sigmoid, sigmoid_of
from conevo.kernels.random import uniform
from conevo.kernels.views import view_of
from conevo.rng import uniforms
from oracles import rover_oracle, splitmix

engine.start()
wp.set_module_options(engine.options)  # without adjoints, as in the worlds
weights_of, memory_of = view_of(SrnWeights), view_of(SrnMemory)


@wp.kernel
def draw(seed: wp.uint64, t: wp.array[int], a: wp.array[int], b: wp.array[int], u: wp.array[float]):
    k = wp.tid()
    u[k] = uniform(seed, t[k], a[k], b[k])


@wp.kernel
def sector(x: wp.array[float], y: wp.array[float], o: wp.array[int]):
    k = wp.tid()
    o[k] = octant(x[k], y[k])


@wp.kernel
def cover(grids: wp.array[wp.uint64], discs: wp.array[wp.vec3f], gained: wp.array[int]):
    for k in range(discs.shape[0]):
        d = discs[k]
        for part in range(1 + k % 3):
            n = cover_disc(grids, (k % 2) * COVER_WORDS, d[0], d[1], d[2], part, 1 + k % 3)
            gained[k] = gained[k] + n
    for word in range(COVER_WORDS):
        gained[discs.shape[0]] = gained[discs.shape[0]] + covered_by_any(grids, 2, word)


@wp.kernel
def squash(a: wp.array[float], y: wp.array[float]):
    k = wp.tid()
    y[k] = sigmoid(a[k])


@wp.kernel
def run_networks(
    brains: SrnWeights,
    memories: SrnMemory,
    shape: SrnShape,
    genes: wp.array2d[float],
    slots: wp.array3d[int],
    sensors: wp.array2d[float],
    inputs: wp.array2d[float],
    sums: wp.array2d[float],
    outputs: wp.array3d[float],
):
    weights = weights_of(brains, 1, 2)  # the second of two teams: views must not overlap
    memory = memory_of(memories, 1, 2)
    for i in range(2):
        load(weights, shape, i, genes, slots, 0)
        clear(memory, shape, i)
    for t in range(sensors.shape[0]):
        for i in range(2):
            for k in range(shape.n_sensors):
                inputs[i, k] = sensors[t, k]
            think(weights, memory, shape, inputs, sums, i)
            for o in range(shape.n_outputs):
                outputs[t, i, o] = sigmoid(sums[i, o])


def array(values, dtype):
    return wp.array(np.asarray(values), dtype=dtype, device="cpu")


def test_uniform_is_splitmix_of_its_counter():
    rng = np.random.default_rng(1)
    t, a, b = (rng.integers(0, 2**20, 2000).astype(np.int32) for _ in range(3))
    seed = 2**63 + 12345
    u = wp.zeros(2000, dtype=float, device="cpu")
    wp.launch(
        draw, 2000, [wp.uint64(seed), array(t, int), array(a, int), array(b, int), u], device="cpu"
    )
    expected = [splitmix.uniform(seed, *map(int, c)) for c in zip(t, a, b, strict=True)]
    assert u.numpy().tolist() == expected
    assert uniforms(np.array([seed], np.uint64), t, a, b).tolist() == expected  # also numpy's


def test_uniform_is_uniform_and_neighbours_are_uncorrelated():
    n = 40_000
    t = np.arange(n, dtype=np.int32) // 200
    a = np.arange(n, dtype=np.int32) % 200
    u = wp.zeros(n, dtype=float, device="cpu")
    zeros = array(np.zeros(n), int)
    wp.launch(draw, n, [wp.uint64(0), array(t, int), array(a, int), zeros, u], device="cpu")
    v = u.numpy().astype(float)
    counts = np.histogram(v, bins=100, range=(0, 1))[0]
    chi2 = ((counts - n / 100) ** 2 / (n / 100)).sum()
    assert 99 - 5 * math.sqrt(198) < chi2 < 99 + 5 * math.sqrt(198)
    assert abs(np.corrcoef(v[:-1], v[1:])[0, 1]) < 5 / math.sqrt(n)
    assert abs(np.corrcoef(v[:-200], v[200:])[0, 1]) < 5 / math.sqrt(n)


def test_octant_counts_counter_clockwise_from_east():
    angles = np.concatenate(
        [np.arange(8) * math.pi / 4 + 0.01, np.arange(1, 9) * math.pi / 4 - 0.01]
    )
    x, y = np.cos(angles).astype(np.float32), np.sin(angles).astype(np.float32)
    axes = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]])
    x = np.concatenate([x, axes[:, 0]]).astype(np.float32)
    y = np.concatenate([y, axes[:, 1]]).astype(np.float32)
    o = wp.zeros(len(x), dtype=int, device="cpu")
    wp.launch(sector, len(x), [array(x, float), array(y, float), o], device="cpu")
    assert o.numpy().tolist() == [*range(8), *range(8), *range(8)]
    assert o.numpy().tolist() == [
        rover_oracle.octant(float(p), float(q)) for p, q in zip(x, y, strict=True)
    ]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(0, 0.99609375, width=32, allow_subnormal=False),
            st.floats(0, 0.99609375, width=32, allow_subnormal=False),
            st.floats(0.015625, 0.25, width=32, allow_subnormal=False),
        ),
        min_size=1,
        max_size=6,
    )
)
def test_cover_disc_marks_the_cells_whose_centre_is_inside(discs):
    grids = wp.zeros(2 * int(COVER_WORDS), dtype=wp.uint64, device="cpu")
    gained = wp.zeros(len(discs) + 1, dtype=int, device="cpu")
    values = np.array(discs, dtype=np.float32)
    wp.launch(cover, 1, [grids, array(values, wp.vec3f), gained], device="cpu")
    centre = (np.arange(100) + 0.5) / 100
    seen = np.zeros((2, 100, 100), dtype=bool)
    sure, maybe = [], []
    for k, (x, y, r) in enumerate(values.astype(float)):
        d = np.hypot(centre[None, :] - x, centre[:, None] - y)
        before = seen[k % 2].sum()
        maybe.append((np.abs(d - r) < 1e-6).sum())  # too close to call in float32
        seen[k % 2] |= d < r
        sure.append(seen[k % 2].sum() - before)
    slack = sum(maybe)
    assert np.abs(gained.numpy()[:-1] - sure).max() <= slack
    assert abs(gained.numpy()[-1] - (seen[0] | seen[1]).sum()) <= slack
    bits = np.unpackbits(grids.numpy().view(np.uint8), bitorder="little").reshape(2, 100, 128)
    assert (bits[:, :, :100] != seen).sum() <= slack
    assert not bits[:, :, 100:].any()


def test_sigmoid_is_the_logistic_function_within_a_millionth():
    a = np.linspace(-60, 60, 100_001, dtype=np.float32)
    y = wp.zeros(len(a), dtype=float, device="cpu")
    wp.launch(squash, len(a), [array(a, float), y], device="cpu")
    assert np.abs(y.numpy() - 1 / (1 + np.exp(-a.astype(float)))).max() < 1e-6
    assert (np.diff(y.numpy()) >= -1e-6).all()
    assert y.numpy().tobytes() == sigmoid_of(a).tobytes()  # numpy's equals it bit for bit


def run_kernel(mind, n_sensors, n_outputs, genes, slots, sensors):
    """Outputs [T, 2, O] of the second of two teams of two robots; those of the first stay empty."""
    kind = mind.mind(n_sensors, n_outputs)
    made = []
    for struct in (SrnWeights, SrnMemory):
        names = dimensions(struct, lambda _: ("robots",))
        made.append(
            allocate(struct, shapes(names, kind.sizes | {"robots": 2, "team": 1}), 2, "cpu")
        )
        for name in struct.vars:
            getattr(made[-1], name).numpy()[:] = -7
    weights, memory = made
    inputs, sums = (wp.zeros((2, n), dtype=float, device="cpu") for n in (n_sensors, n_outputs))
    outputs = wp.zeros((len(sensors), 2, n_outputs), dtype=float, device="cpu")
    given = [array(genes, float), array(slots[None], int), array(sensors, float)]
    arguments = [weights, memory, kind.shape, *given, inputs, sums, outputs]
    wp.launch(run_networks, 1, arguments, device="cpu")
    for struct in (weights, memory):
        for name in struct._cls.vars:
            first, _ = np.split(getattr(struct, name).numpy(), 2)
            assert (first == -7).all(), name
    return outputs.numpy()


@pytest.mark.parametrize(
    ("n_sensors", "n_context", "n_outputs", "n_slots", "bias"),
    [(16, 10, 5, 20, 0.0), (16, 6, 2, 12, 0.0), (8, 0, 2, 5, 0.0), (27, 10, 8, 20, 1.0)],
)
def test_think_is_an_elman_network(n_sensors, n_context, n_outputs, n_slots, bias):
    """Against the same network in float64 numpy, over ten iterations, with empty slots."""
    rng = np.random.default_rng(n_slots)
    genes = rng.uniform(-0.1, 0.1, (60, n_sensors + n_context + n_outputs)).astype(np.float32)
    slots = np.full((2, n_slots), -1, dtype=np.int32)
    slots[0] = rng.permutation(60)[:n_slots]
    slots[0, 2] = -1
    slots[1, : n_slots // 2] = rng.permutation(60)[: n_slots // 2]
    sensors = rng.random((10, n_sensors)).astype(np.float32)
    mind = Srn(
        n_hidden=n_context or n_slots,
        max_hidden=n_slots,
        recurrent=n_context > 0,
        bias=bool(bias),
    )
    outputs = run_kernel(mind, n_sensors, n_outputs, genes, slots, sensors)
    for i in range(2):
        context = np.zeros(n_context)
        for t in range(10):
            inputs = np.concatenate([sensors[t], context])
            hidden = np.zeros(n_slots)
            out = np.full(n_outputs, bias)
            for k, row in enumerate(slots[i]):
                if row >= 0:
                    weights = 10 * genes[row].astype(float)
                    hidden[k] = 1 / (1 + np.exp(-(bias + weights[: len(inputs)] @ inputs)))
                    out += weights[len(inputs) :] * hidden[k]
            assert np.abs(outputs[t, i] - 1 / (1 + np.exp(-out))).max() < 2e-5
            context = hidden[:n_context]
