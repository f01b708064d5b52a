"""Epochs of a world run step by step in several forms at once, and the faults that they reveal.

The same teams play with robots visited in the order of a rollout, in reverse and in random order,
and in memory that another epoch has used. All forms must agree, bit for bit, after each step.
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from conevo.rng import stream
from conevo.worlds.contract import dimensions_of
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import Scenarios, World
from conevo.worlds.walk import Arrays, Order, Walk

__all__ = ["Trial"]

SENTINEL = np.full(1, -7.7712321e-19, np.float32)  # never a result: it marks unwritten elements
RESULTS = ("fitness", "counts", "switches", "performance")
Seen = tuple[str, list[str], str]  # topic, problems, text without problems


class Trial:
    """Runs epochs step by step and checks them.

    Args:
        world: the world.
        genes: pool of neuron genotypes [K, G].
        teams: pool rows of the neurons [N, R, U]; at the end one for each heuristic controller.
        heuristic: [N, R].
        scenarios: E scenarios.

    Attributes:
        plain: the epochs in the order of a rollout.
    """

    def __init__(
        self,
        world: World,
        genes: npt.NDArray[np.float32],
        teams: npt.NDArray[np.int32],
        heuristic: npt.NDArray[np.int32],
        scenarios: Scenarios,
    ) -> None:
        self.world = world
        self._task = (world, genes, teams, scenarios, heuristic)
        self._n_teams, self._heuristic = len(teams), heuristic
        self.plain = Walk(*self._task)
        self.n_worlds = self.plain.n_worlds
        self._simulation = world.simulation()
        self._has_phases = isinstance(self._simulation.functions["sense"], tuple)
        self._order: list[str] = []
        self._sensors: list[str] = []
        self._counts: list[str] = []
        self._changed_at_end: list[str] = []
        self._executed = np.zeros((self.n_worlds, world.n_robots, len(world.actions)), int)
        self._switched = np.zeros((self.n_worlds, world.n_robots), int)
        self._action = np.full((self.n_worlds, world.n_robots), -1, np.int32)

    def run(self) -> Iterator[None]:
        """Run the epochs; an index outside its array ends the process. It yields often."""
        plain, iterations = self.plain, self.world.params.iterations
        robots = stream(1, "check", "order")
        others = {"reverse": Walk(*self._task), "random": Walk(*self._task)}
        for name in ("fitness", "performance"):
            for walk in (plain, *others.values()):
                walk.arrays()[name][:] = SENTINEL
        for step, t in plain.epoch(iterations):
            if step == "sense" and t in (0, 1, iterations // 2) and not self._has_phases:
                self._look_at_sensors(t)
            before = {name: values.copy() for name, values in plain.arrays().items()}
            yield
            plain.step(step, plain.natural, t)
            for kind, walk in list(others.items()):
                order = plain.natural
                if kind == "reverse":
                    order = order[:, ::-1]
                elif kind == "random":
                    order = robots.permuted(order, axis=1)
                yield
                walk.step(step, order, t)
                if found := self._differences(plain.arrays(), walk.arrays()):
                    del others[kind]
                    if not self._order:
                        self._explain_order(step, t, found, before)
            if step == "resolve":
                self._count(plain.arrays()["action"])
            elif step == "outcome":
                now = plain.arrays()
                for name in ("fitness", "counts", "switches"):
                    if before[name].tobytes() != now[name].tobytes():
                        self._changed_at_end.append(name)

    def _count(self, action: npt.NDArray[np.int32]) -> None:
        """Add the actions executed in one iteration to the counts that the world must have."""
        n = len(self.world.actions)
        if not self._counts and ((action < -1) | (action >= n)).any():
            bad = action[(action < -1) | (action >= n)][0]
            self._counts.append(f"action is {bad}; it must be -1 (none) or 0 to {n - 1}")
        for a in range(n):
            self._executed[:, :, a] += action == a
        self._switched += (self._action >= 0) & (action >= 0) & (self._action != action)
        self._action = action.copy()

    def _look_at_sensors(self, t: int) -> None:
        """Run "sense" alone, robot by robot, on inputs filled with the sentinel."""
        if self._sensors:
            return
        arrays, names = self.plain.arrays(), self.world.inputs
        kept = {name: values.copy() for name, values in arrays.items()}
        mark = SENTINEL.view(np.uint32)[0]
        plays = np.repeat(self._heuristic < 0, self.n_worlds // self._n_teams, axis=0)
        written = np.zeros((self.world.n_robots, len(names)), bool)
        for i in range(self.world.n_robots):
            arrays["inputs"][:] = SENTINEL
            self.plain.step("sense", _only(self.plain.natural, i), t)
            seen = (arrays["inputs"].view(np.uint32) != mark)[plays[:, i]]
            written[i] = seen[:, i].any(axis=0)
            seen[:, i] = False
            if seen.any():
                _, robot, _ = (int(x[0]) for x in np.nonzero(seen))
                self._sensors.append(f"sense writes inputs of robot {robot} for robot {i}")
                break
            for name, values in arrays.items():
                values[:] = kept[name]
        for name, values in arrays.items():
            values[:] = kept[name]
        if missing := [] if self._sensors else np.flatnonzero(~written.any(axis=0)).tolist():
            which = ", ".join(f"{k} ({names[k]})" for k in missing)
            self._sensors.append(f"sense never writes input {which}")

    def _explain_order(self, step: str, t: int, names: list[str], before: Arrays) -> None:
        """Explain which step depends on the order of robots, and who writes another's data."""
        text = (
            f"{step} gives other results if robots are visited in another order "
            f"({', '.join(f'`{name}`' for name in names)} differ in iteration {t})"
        )
        probe, r = Walk(*self._task), self.world.n_robots
        probe.step("reset", probe.natural)  # loads the networks
        arrays = probe.arrays()
        named = dimensions_of(self._simulation)
        shared = {name for name, those in named.items() if those[0] != "robots"}
        foreign: dict[str, tuple[int, int]] = {}
        common: dict[str, set[int]] = {}
        for i in range(r):
            for name, values in arrays.items():
                values[:] = before[name]
            probe.step(step, _only(probe.natural, i), t)
            for name in self._differences(before, arrays):
                is_other = before[name].view(np.uint8) != arrays[name].view(np.uint8)
                if name in shared:
                    common.setdefault(name, set()).add(i)
                    continue
                rows = is_other.reshape(self.n_worlds, r, -1).any(axis=(0, 2))
                rows[i] = False
                if rows.any():
                    foreign.setdefault(name, (i, int(np.flatnonzero(rows)[0])))
        if foreign:
            name, (i, j) = next(iter(foreign.items()))
            text += f": robot {i} writes `{name}` of robot {j}; a phase writes its own robot's data"
        elif common:
            name, who = next(iter(common.items()))
            those = f"robot {min(who)} writes" if len(who) == 1 else f"{len(who)} robots write"
            text += (
                f": {those} `{name}`, which others read or write in the same phase; move it in "
                f"settle(team, scene, p, t), which runs once for the team"
            )
        else:
            text += ": a robot reads what another writes in the same phase"
        self._order.append(text)

    def seen(self) -> Iterator[Seen]:
        """Yield topics with their problems, after the run."""
        n = len(self.world.inputs)
        fine = f"all {n} inputs are written, and nothing else"
        if self._has_phases:
            fine = "not checked: sense has phases over other items"
        yield "sensors", self._sensors, fine
        yield "values", list(self._of_values()), "fitness and performance are written and finite"
        done = np.asarray(self._executed.any(axis=(0, 1)))
        idle = ", ".join(name for a, name in enumerate(self.world.actions) if not done[a])
        never = f"; never executed here: {idle}" if idle else ""
        yield "counts", list(self._of_counts()), f"sum up to the executed actions{never}"
        yield "order", self._order, "robots in reverse and in random order: equal bit for bit"
        yield "reset", list(self._of_reset()), "nothing of another epoch is left over"
        yield "heuristics", list(self._of_heuristics()), f"{len(self.world.heuristics)} play"

    def _of_values(self) -> Iterator[str]:
        arrays = self.plain.arrays()
        mark = SENTINEL.view(np.uint32)[0]
        if (arrays["fitness"].view(np.uint32) == mark).any():
            yield "fitness is never written: every robot gets one in reset or resolve"
        elif bad := int((~np.isfinite(arrays["fitness"])).sum()):
            yield f"fitness is not finite: {bad} of {arrays['fitness'].size} values"
        for name in self._changed_at_end:
            yield (
                f"outcome writes {name}, which must be right after each iteration: write it in "
                f"resolve; outcome writes performance"
            )
        for k, measure in enumerate(measures_of(self.world)):
            values = arrays["performance"][:, k]
            if (np.ascontiguousarray(values).view(np.uint32) == mark).any():
                yield f"performance[{k}] ({measure.name}) is never written: outcome writes it"
            elif bad := int((~np.isfinite(values)).sum()):
                yield f"{measure.name} is not finite: {bad} of {values.size} epochs"

    def _of_counts(self) -> Iterator[str]:
        yield from self._counts
        if self._counts:
            return
        world, arrays = self.world, self.plain.arrays()
        counts = arrays["counts"].reshape(self.n_worlds, world.n_robots, len(world.castes))
        if not np.array_equal(counts.sum(axis=2), self._executed.sum(axis=2)):
            yield (
                f"counts sum up to {int(counts.sum())}, but `action` shows "
                f"{int(self._executed.sum())} executed actions; count each once, in one caste"
            )
        elif world.castes == world.actions and not np.array_equal(counts, self._executed):
            a = int(np.flatnonzero((counts != self._executed).any(axis=(0, 1)))[0])
            yield f"counts of {world.actions[a]!r} are not those of the action that was executed"
        if not np.array_equal(arrays["switches"], self._switched):
            yield "switches are not those of `action`; count_action counts them"
        if not self._executed.any():
            yield "no robot ever executes an action"

    def _of_reset(self) -> Iterator[str]:
        used, fresh = Walk(*self._task), Walk(*self._task)
        for name, values in used.arrays().items():
            values[:] = self.plain.arrays()[name][::-1]
        for walk in (used, fresh):
            walk.step("reset", walk.natural)
        left = self._differences(used.arrays(), fresh.arrays())
        for step, t in used.epoch(self.world.params.iterations):
            used.step(step, used.natural, t)
        ended, should = used.arrays(), self.plain.arrays()
        if wrong := [n for n in RESULTS if ended[n].tobytes() != should[n].tobytes()]:
            yield (
                f"{', '.join(wrong)} depend on the previous epoch in the same memory; reset leaves "
                f"{', '.join(f'`{name}`' for name in left)} as they were"
            )

    def _differences(self, a: Arrays, b: Arrays) -> list[str]:
        """Return the names of the arrays that differ, without scratch."""
        bits = (
            (n, a[n].view(np.uint8), b[n].view(np.uint8))
            for n in a
            if n not in self._simulation.scratch
        )
        return [name for name, one, other in bits if not np.array_equal(one, other)]

    def _of_heuristics(self) -> Iterator[str]:
        names = self.world.heuristics
        counts = self.plain.arrays()["counts"].reshape(self._n_teams, -1)
        first = self._n_teams - len(names)
        played = {counts[0].tobytes(): "a team of networks"}
        for name, row in zip(names, counts[first:], strict=True):
            if other := played.get(row.tobytes()):
                yield f"{name!r} does exactly what {other} does"
            played[row.tobytes()] = repr(name)

    def unplayed_heuristics(self) -> Iterator[str]:
        """Yield a line for each that plays like a network without neurons, as if unknown to act.

        This includes one that is meant to play like such a network.
        """
        world, genes, teams, scenarios, heuristic = self._task
        nobody = np.full_like(teams[:1], -1), scenarios, np.full_like(heuristic[:1], -1)
        idle = Walk(world, genes, *nobody)
        for step, t in idle.epoch(world.params.iterations):
            idle.step(step, idle.natural, t)
        ended, all_ended = idle.arrays(), self.plain.arrays()
        for k, name in enumerate(world.heuristics):
            team = self._n_teams - len(world.heuristics) + k
            rows = slice(team * len(scenarios), (team + 1) * len(scenarios))
            if all(ended[one].tobytes() == all_ended[one][rows].tobytes() for one in RESULTS):
                yield (
                    f"{name!r} does exactly what a network with equal outputs does: does act have "
                    f"a case for heuristic {k}?"
                )


def _only(order: Order, i: int) -> Order:
    """Return an order in which only robot ``i`` is visited."""
    return np.where(np.arange(order.shape[1]) == 0, i, -1).astype(np.int32) + np.zeros_like(order)
