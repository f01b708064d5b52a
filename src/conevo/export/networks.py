"""The equations of the package's controllers, and their weights, as files need them.

The operations are those of the kernels, in the same order, and so are their results. Weights are
numbers of their own: genes times ``weight_scale``, zeros in empty slots. Slots after the last
neuron of a team are left out.

Sets of rules, and thresholds that are learned, have no equations here, since they compare numbers:
files have arithmetic alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from conevo.controllers.protocol import Bools, Controller
from conevo.errors import UsageError
from conevo.export.arithmetic import Arithmetic, Floats

__all__ = ["Equations", "ExportedNetwork", "network_of"]

Equations = Callable[[Arithmetic, Any, Any], tuple[Any, Any]]


@dataclass(frozen=True)
class ExportedNetwork:
    """The networks of a team, all of one kind.

    Attributes:
        weights: arrays by name, [R, U] or [R, J, U], float32.
        n_inputs: S.
        n_context: C, numbers that a robot remembers, zeros at first.
        n_outputs: O.
        equations: from an arithmetic, observations [R, S] and context [R, C] to outputs [R, O] and
            the next context [R, C].
    """

    weights: dict[str, Floats]
    n_inputs: int
    n_context: int
    n_outputs: int
    equations: Equations

    @property
    def n_robots(self) -> int:
        """R."""
        return len(next(iter(self.weights.values())))


def network_of(
    controller: Controller, genes: Floats, active: Bools, n_inputs: int, n_outputs: int
) -> ExportedNetwork:
    """Return the networks of some robots.

    Args:
        controller: their kind, with its settings.
        genes: [R, U, G] float32, genotypes of the parts of each robot.
        active: [R, U] whether a slot contains a part.
        n_inputs: S.
        n_outputs: O.

    Raises:
        UsageError: a kind of controller, or a setting, without equations here.
    """
    if controller.name not in KINDS:
        raise UsageError(
            f"controller {controller.name!r} cannot be exported: its equations are not in "
            f"conevo/export/networks.py (known: {', '.join(KINDS)})"
        )
    settings: Any = controller
    filled = np.flatnonzero(active.any(axis=0))
    n_parts = controller.genome(n_inputs, n_outputs).n_parts
    used = max(int(filled[-1]) + 1 if filled.size else 1, n_parts)
    genes, active = genes[:, :used], active[:, :used]
    scaled = np.where(active[..., None], np.float32(settings.weight_scale) * genes, np.float32(0))
    weights, n_context, equations = KINDS[controller.name](
        settings, scaled, genes, active.astype(np.float32), n_inputs
    )
    weights = {name: np.ascontiguousarray(values) for name, values in weights.items()}
    return ExportedNetwork(weights, n_inputs, n_context, n_outputs, equations)


def _srn(
    settings: Any, scaled: Floats, genes: Floats, filled: Floats, n_inputs: int
) -> tuple[dict[str, Floats], int, Equations]:
    """A simple recurrent network; its context is the activations of the first ``n_hidden``."""
    n_context, bias = settings.n_context, float(settings.bias)
    n_seen = n_inputs + n_context

    def equations(ops: Arithmetic, observations: Any, context: Any) -> tuple[Any, Any]:
        seen = ops.join("seen", observations, context) if n_context else observations
        drive = ops.weighted("drive", "w_in", seen, ops.number(bias))
        active = ops.sigmoid("active", drive)
        hidden = ops.each("hidden", active, "*", ops.weight("filled"))
        outputs = ops.weighted("outputs", "w_out", hidden, ops.number(bias))
        if not n_context:
            return outputs, context
        return outputs, ops.columns("next_context", hidden, 0, n_context)

    weights = {
        "w_in": scaled[:, :, :n_seen].transpose(0, 2, 1),
        "w_out": scaled[:, :, n_seen:],
        "filled": filled,
    }
    return weights, n_context, equations


def _ctrnn(
    settings: Any, scaled: Floats, genes: Floats, filled: Floats, n_inputs: int
) -> tuple[dict[str, Floats], int, Equations]:
    """A continuous-time network; its context is activations of ``n_hidden``, then all states."""
    f, n_hidden, used = np.float32, settings.n_hidden, genes.shape[1]
    n_seen = n_inputs + n_hidden

    def equations(ops: Arithmetic, observations: Any, context: Any) -> tuple[Any, Any]:
        fed = ops.columns("fed", context, 0, n_hidden)
        state = ops.columns("state", context, n_hidden, n_hidden + used)
        seen = ops.join("seen", observations, fed)
        drive = ops.weighted("drive", "w_in", seen, ops.weight("bias"))
        distance = ops.each("distance", drive, "-", state)
        step = ops.each("step", ops.weight("rate"), "*", distance)
        next_state = ops.each("next_state", state, "+", step)
        active = ops.sigmoid("active", next_state)
        hidden = ops.each("hidden", active, "*", ops.weight("filled"))
        outputs = ops.weighted("outputs", "w_out", hidden, ops.number(0))
        next_fed = ops.columns("next_fed", hidden, 0, n_hidden)
        return outputs, ops.join("next_context", next_fed, next_state)

    share = f(0.5) * (genes[:, :, n_seen + 1] + f(1))
    weights = {
        "w_in": scaled[:, :, :n_seen].transpose(0, 2, 1),
        "bias": scaled[:, :, n_seen],
        "rate": f(1) / (f(1) + share * (f(settings.slowest) - f(1))),
        "w_out": scaled[:, :, n_seen + 2 :],
        "filled": filled,
    }
    return weights, n_hidden + used, equations


def _gru(
    settings: Any, scaled: Floats, genes: Floats, filled: Floats, n_inputs: int
) -> tuple[dict[str, Floats], int, Equations]:
    """A gated network; its context is the activations of all neurons, 0 in empty slots."""
    n_hidden, used = settings.n_hidden, genes.shape[1]
    n_seen = n_inputs + n_hidden

    def equations(ops: Arithmetic, observations: Any, context: Any) -> tuple[Any, Any]:
        fed = ops.columns("fed", context, 0, n_hidden)
        seen = ops.join("seen", observations, fed)
        opened = {}
        for gate in ("reset", "update"):
            drive = ops.weighted(f"{gate}_drive", f"w_{gate}", seen, ops.weight(f"b_{gate}"))
            opened[gate] = ops.sigmoid(gate, drive)
        reset, update = opened["reset"], opened["update"]
        kept = ops.each("kept", ops.columns("reset_fed", reset, 0, n_hidden), "*", fed)
        seen = ops.join("seen_again", observations, kept)
        drive = ops.weighted("candidate_drive", "w_candidate", seen, ops.weight("b_candidate"))
        halved = ops.sigmoid("half_candidate", ops.each("doubled", ops.number(2), "*", drive))
        twice = ops.each("twice", ops.number(2), "*", halved)
        candidate = ops.each("candidate", twice, "-", ops.number(1))
        old = ops.each("old", update, "*", context)
        rest = ops.each("rest", ops.number(1), "-", update)
        gained = ops.each("gained", rest, "*", candidate)
        hidden = ops.each("next_context", old, "+", gained)
        return ops.weighted("outputs", "w_out", hidden, ops.number(0)), hidden

    weights = {}
    for k, gate in enumerate(("reset", "update", "candidate")):
        at = k * (n_seen + 1)
        weights[f"w_{gate}"] = scaled[:, :, at : at + n_seen].transpose(0, 2, 1)
        weights[f"b_{gate}"] = scaled[:, :, at + n_seen]
    weights["w_out"] = scaled[:, :, 3 * (n_seen + 1) :]
    return weights, used, equations


def _thresholds(
    settings: Any, scaled: Floats, genes: Floats, filled: Floats, n_inputs: int
) -> tuple[dict[str, Floats], int, Equations]:
    """Response thresholds that do not change; there is no context.

    Raises:
        UsageError: thresholds that are learned.
    """
    if settings.is_learning:
        raise UsageError(
            f"controller.xi = {settings.xi} and controller.phi = {settings.phi}: thresholds that "
            f"are learned cannot be exported, only those with xi = phi = 0"
        )
    n_factors = settings.steepness - 1

    def equations(ops: Arithmetic, observations: Any, context: Any) -> tuple[Any, Any]:
        drive = ops.weighted("drive", "w_in", observations, ops.weight("bias"))
        stimulus = above = ops.sigmoid("stimulus", drive)
        for k in range(n_factors):
            above = ops.each(f"power_{k + 2}", above, "*", stimulus)
        total = ops.each("total", above, "+", ops.weight("theta"))
        quotient = ops.each("quotient", above, "/", total)
        response = ops.each("response", quotient, "*", ops.weight("filled"))
        twice = ops.each("twice", ops.number(2), "*", response)
        balance = ops.each("balance", twice, "-", ops.number(1))
        return ops.each("outputs", ops.weight("gain"), "*", balance), context

    w_in, bias, theta = settings.tasks(genes, n_inputs)
    below = theta
    for _ in range(n_factors):
        below = below * theta
    gain = np.where(filled.any(axis=1, keepdims=True), np.float32(settings.gain), np.float32(0))
    weights = {
        "w_in": w_in.transpose(0, 2, 1),
        "bias": bias,
        "theta": below,
        "gain": np.broadcast_to(gain, filled.shape),
        "filled": filled,
    }
    return weights, 0, equations


KINDS = {"srn": _srn, "ctrnn": _ctrnn, "gru": _gru, "thresholds": _thresholds}
