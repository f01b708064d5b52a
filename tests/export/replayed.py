"""Exported files played along an epoch that the kernels have played, with their own context."""

import ctypes
import importlib.util
import io
import subprocess

import numpy as np

from conevo.export.files import export
from conevo.export.networks import KINDS, network_of
from conevo.export.team import EvolvedTeam
from conevo.rng import stream
from conevo.worlds.rollout import Rollout
from export.needed import compiler, package

FLAGS = ("-std=c99", "-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Wdouble-promotion",
          "-Werror")  # fmt: skip


def kinds_for(task):
    """Return the kinds of controllers to try in a task: all in two worlds, one in the others.

    No world changes the functions of a controller, and each pair of them is a kernel to compile.
    """
    return tuple(KINDS) if task.startswith("pursuit/") or ".py:" in task else tuple(KINDS)[:1]


def recorded(world, controller, seed=3):
    """Return a team with holes, and observations [T, R, S] and outputs [T, R, O] of its epoch.

    Its first robot is empty, its last one full.
    """
    rollout = Rollout(world, controller, n_threads=1)
    rng, genome, r = stream(seed, "exported"), rollout.genome, world.n_robots
    pool = rng.uniform(-1, 1, (50, genome.n_genes)).astype(np.float32)
    pool[:5] *= 0.01  # of which no unit saturates
    rows = rng.integers(len(pool), size=(r, genome.max_parts)).astype(np.int32)
    holes = rng.random(rows.shape) < rng.random((r, 1))
    holes[0], holes[-1] = True, False
    rows[holes] = -1
    seen = rollout.record(pool, rows, world.scenarios([seed]))
    return team_of(world, controller, pool[rows], rows >= 0), seen["inputs"], seen["outputs"]


def team_of(world, controller, genes, active, robots=None):
    """Return a team, or some of its robots, as of a run."""
    robots = list(range(len(genes))) if robots is None else robots
    sizes = (len(world.inputs), len(world.outputs))
    about = {
        "format": "conevo-team-1", "conevo": "0", "task": f"{world.name}/{world.environment}",
        "method": "none", "n_robots": len(genes), "robots": robots,
        "sensors": list(world.inputs), "outputs": list(world.outputs),
        "controller": {"name": controller.name},
    }  # fmt: skip
    return EvolvedTeam(about, network_of(controller, genes[robots], active[robots], *sizes))


def played(step, team, observations):
    """Return the outputs [T, R, O] along an epoch, each step with the context of the last one."""
    context, found = team.first_context, []
    for seen in observations:
        outputs, context = step(seen, context)
        found.append(np.asarray(outputs))
    return np.stack(found)


# --- steps of each format -------------------------------------------------------------------------


def step_of(team, folder, ending, **options):
    """Return the step of a team's file: observations and context to outputs and next context."""
    needs = {".onnx": ("onnx", "onnxruntime"), ".pt2": ("torch",)}
    for name in needs.get(ending, ()):
        package(name)
    path = export(team, folder / f"team{ending}", **options)
    return {".py": of_python, ".npz": of_npz, ".onnx": of_onnx, ".pt2": of_torch, ".h": of_c}[
        ending
    ](path, team)


def of_python(path, team):
    spec = importlib.util.spec_from_file_location("exported_team", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.step


def of_npz(path, team):
    """The same equations with the weights of the file."""
    from dataclasses import replace

    with np.load(path) as archive:
        weights = {name: archive[name] for name in archive.files if name != "about"}
    return replace(team, network=replace(team.network, weights=weights)).step


def of_onnx(path, team):
    runtime = package("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    session = runtime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    return lambda seen, context: session.run(None, {"observations": seen, "context": context})


def of_torch(path, team):
    torch = package("torch")
    program = torch.export.load(io.BytesIO(path.read_bytes())).module()
    tensor = torch.from_numpy
    return lambda seen, context: [x.numpy() for x in program(tensor(seen), tensor(context))]


def of_c(path, team):
    net = team.network
    library = path.with_suffix(".so")
    source = path.with_suffix(".c")
    source.write_text(
        f'#include "{path.name}"\n'
        "void reset(team_state *s);\nvoid reset(team_state *s) "
        "{ team_state empty = {0}; *s = empty; }\n"
        "unsigned long size(void);\nunsigned long size(void) { return sizeof(team_state); }\n"
        "void step(team_state *s, const float *in, float *out);\n"
        "void step(team_state *s, const float *in, float *out) { team_step(s, in, out); }\n"
    )
    subprocess.run([compiler(), *FLAGS, *STRICT, "-o", library, source], check=True)
    loaded = ctypes.CDLL(str(library))
    state = ctypes.create_string_buffer(loaded.size())
    loaded.reset(state)

    def step(seen, context):
        seen, outputs = np.ascontiguousarray(seen), np.zeros((net.n_robots, net.n_outputs), "f4")
        loaded.step(state, ctypes.c_void_p(seen.ctypes.data), ctypes.c_void_p(outputs.ctypes.data))
        kept = np.frombuffer(state.raw, np.float32).reshape(net.n_robots, -1)
        return outputs, kept[:, : net.n_context].copy()

    return step
