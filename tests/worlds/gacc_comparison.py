"""Whether a recorded epoch of the gathering world is the oracle's, phase by phase.

Every iteration starts from the previous recorded state, so differences of float32 and float64 do
not grow. If a comparison is within float32's rounding of its threshold, the kernel must agree with
the oracle for a state within this rounding; such ties are counted, and are rare.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest

from conevo.rng import stream
from conevo.worlds.rollout import Rollout
from oracles import gacc_oracle as oracle
from oracles.gacc_scene import NONE, UNDETECTED, Network
from worlds.gathering import build, load, state, twin

LIFE = ("LYING", "GRIPPED", "CARRIED", "WAITING", "HELPED", "DELIVERED", "DROPPED")
TOLERANCE = {"x": 1e-6, "y": 1e-6, "object_x": 1e-6, "object_y": 1e-6, "demand": 1e-6}


@dataclass
class Tally:
    """Counts of comparisons: near-ties and, so that they are not vacuous, events."""

    steps: int = 0
    near_ties: int = 0
    events: Counter = field(default_factory=Counter)

    def __iadd__(self, other):
        self.steps += other.steps
        self.near_ties += other.near_ties
        self.events += other.events
        return self


def nearby(w, n=60):
    """Copies of a world within rounding; things in one place stay together."""
    rng = stream(0, "nearby")
    for k in range(n):
        other = twin(w)
        grain = 10.0 ** -(7 - k % 3)
        shifts = {}
        for thing in (*other.robots, *other.objects):
            dx, dy = shifts.setdefault((thing.x, thing.y), rng.normal(size=2) * grain)
            thing.x, thing.y = thing.x + dx, thing.y + dy
        for robot in other.robots:
            robot.energy += rng.normal() * 1e-6
        yield other


def differences(w, seen, t, atol=0.0):
    """The parts of the state after an iteration that differ from the record."""
    found = []
    for name, ours in state(w).items():
        theirs = seen[name][t].ravel().astype(float)
        scale = 1e-4 if name == "energy" else TOLERANCE.get(name, 0.0)
        far = np.abs(theirs - ours) > (scale and max(scale, atol))
        found += [f"{name}[{i}] {theirs[i]:g}, not {ours[i]:g}" for i in np.flatnonzero(far)]
    return found


def check_senses(w, i, inputs, tally):
    """Return the objects that robot i sees, after asserting that its inputs are right."""
    expected, found = oracle.sense(w, i)
    if np.abs(inputs - expected).max() < 1e-5:
        return found
    tally.near_ties += 1
    for other in nearby(w):
        expected, found = oracle.sense(other, i)
        if np.abs(inputs - expected).max() < 1e-3:
            return found
    expected = np.array(oracle.sense(w, i)[0])
    where = np.flatnonzero(np.abs(inputs - expected) > 1e-5).tolist()
    raise AssertionError(f"iteration {w.t}, robot {i}: inputs {where} are {inputs[where]}, not "
                         f"{expected[where]}")  # fmt: skip


def check_choice(w, i, sums, action, situation, tally):
    """Return robot i's decision, after asserting that its action and situation are right.

    If two of a network's outputs are equal in float32, the sums are changed to the recorded ones.
    """
    decision = oracle.decide(w, i, sums)

    def agrees(one):
        return one.action == action and situation in (one.situation, 4)

    if agrees(decision):
        return decision
    tally.near_ties += 1
    if sums is not None and not oracle.situation(w, i)[0] and action != NONE:
        chosen = {3: (3, 4)}.get(action, (action + (action > 3),))
        o = max(chosen, key=lambda o: sums[o])
        if max(sums) - sums[o] < 1e-3:
            sums[o] = max(sums) + 1e-9
            return oracle.decide(w, i, sums)
    assert any(agrees(oracle.decide(other, i, sums)) for other in nearby(w)), (
        f"iteration {w.t}, robot {i}: action {action} in situation {situation}, not {decision}"
    )
    return decision


def judge(w, sums, detected):
    """Decide, commit and referee."""
    decisions = [oracle.decide(w, i, s) for i, s in enumerate(sums)]
    for block, found in zip(w.objects, detected, strict=True):
        block.detected = found
    oracle.commit(w, decisions)
    oracle.referee(w)


def check_iteration(w, seen, t, tally):
    """Assert that the recorded iteration follows from the oracle's state; leave it the oracle's."""
    inputs, hidden = (seen[name][t].astype(float) for name in ("inputs", "hidden"))
    found, sums = set(), []
    for i, robot in enumerate(w.robots):
        if robot.energy > 0.0:
            found |= check_senses(w, i, inputs[i], tally)
        else:
            assert inputs[i].tolist() == robot.inputs, (t, i)
        sums.append(None)
        if isinstance(robot.mind, Network):
            both = np.array([*inputs[i], *robot.context])
            sums[i], context = robot.mind.think(both, len(robot.context))
            assert np.abs(hidden[i, : len(context)] - context).max() < 1e-4, (t, i)
        action, situation = int(seen["action"][t, i]), int(seen["situation"][t, i])
        check_choice(w, i, sums[i], action, situation, tally)
    detected = [t if k in found and b.detected == UNDETECTED else b.detected
                for k, b in enumerate(w.objects)]  # fmt: skip
    if detected != seen["detected"][t].tolist():
        tally.near_ties += 1
        each = [set().union(*(oracle.sense(other, i)[1] for i in range(len(w.robots))))
                for other in nearby(w)]  # fmt: skip
        for k, (ours, theirs) in enumerate(zip(detected, seen["detected"][t], strict=True)):
            assert ours == theirs or len({k in one for one in each}) == 2, (t, k, ours, theirs)
        detected = seen["detected"][t].tolist()
    before = twin(w)
    judge(w, sums, detected)
    wrong = differences(w, seen, t)
    if wrong:
        tally.near_ties += 1
        for other in nearby(before):
            judge(other, sums, detected)
            if not differences(other, seen, t, atol=5e-5):
                break
        else:
            raise AssertionError(f"iteration {t}: {'; '.join(wrong)}")
    for old, block in zip(before.objects, w.objects, strict=True):
        if old.life != block.life:
            w.note(f"{LIFE[old.life]} -> {LIFE[block.life]}")
        if block.detected == t:
            w.note("detected")
    for old, one in zip(before.complexes, w.complexes, strict=True):
        if one.is_complete and not old.is_complete:
            w.note("last part")
    load(w, seen, t)


def compare(a_world, genes, slots, scenarios, heuristic, seen=None):
    """Assert that a rollout is the oracle's; return the tally."""
    rollout = Rollout(a_world, n_threads=1)
    if seen is None:
        seen = rollout.record(genes, slots, scenarios, heuristic)
    w = build(a_world, genes, slots, scenarios, heuristic)
    tally = Tally(steps=a_world.params.iterations)
    for t in range(a_world.params.iterations):
        check_iteration(w, seen, t, tally)
        tally.events.update(f"demand {k}" for k in demands(w))
    out = rollout.evaluate(genes, slots[None], scenarios, heuristic[None])
    performance = {name: float(values[0, 0]) for name, values in out.performance.items()}
    assert performance == pytest.approx(oracle.performance(w))
    assert out.switches[0, 0].tolist() == [robot.switches for robot in w.robots]
    assert out.counts[0, 0].tolist() == seen["counts"][-1].tolist()
    assert out.fitness[0, 0].tolist() == seen["fitness"][-1].tolist()
    tally.events += w.events
    return tally


def demands(w):
    """Which branches of the demand formula the present state is in."""
    for one in w.complexes:
        built = len(one.built)
        if built < 2:
            yield "silent" if not built else "silent with one part"
        elif one.is_complete:
            yield "complete"
        else:
            for kind in range(3):
                p = one.priority(kind)
                how = "next" if p == 1.0 else "later" if p else "not needed"
                yield f"{'ordered' if one.ordered else 'disordered'} {how}"
    if sum(len(c.built) >= 2 and not c.is_complete for c in w.complexes) > 1:
        yield "of several"
