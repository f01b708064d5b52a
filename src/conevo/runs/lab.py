"""The working parts of a run, made from its configuration."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.controllers.protocol import Controller
from conevo.controllers.registry import genome_of
from conevo.errors import EnvironmentFailure, UsageError
from conevo.evolution.inheritance import breed_from, hand_on, refuse_idle
from conevo.evolution.protocol import FloatArray, Layout, Method, Progress, State
from conevo.outside import takes
from conevo.reading import DamagedFile
from conevo.rng import fold
from conevo.runs.champions import Team
from conevo.runs.config import RunConfig
from conevo.runs.evaluation import Evaluate, make_evaluator, without
from conevo.runs.loop import check_budget, price, rehearse, unscored
from conevo.worlds.own_simulator import OwnSimulator
from conevo.worlds.protocol import Scenarios, Simulator, World
from conevo.worlds.simulators import device_for, simulator

__all__ = [
    "Lab",
    "Price",
    "check_memory",
    "first_team",
    "layout_of",
    "price_of",
    "refuse_other_state",
    "refuse_unfit",
]


def layout_of(world: World, controller: Controller) -> Layout:
    """Return the sizes of a method's problem, given by a world and its robots' controller."""
    genome = genome_of(controller, world)
    return Layout(
        n_robots=world.n_robots,
        n_hidden=genome.n_parts,
        max_hidden=genome.max_parts,
        n_genes=genome.n_genes,
        n_inputs=len(world.inputs),
        n_outputs=len(world.outputs),
    )


@dataclass(frozen=True)
class Price:
    """The cost of a run.

    Attributes:
        evaluations: team evaluations of the first generation; later ones take a few more when the
            size of controllers is adapted.
        generations: the most that its settings and its budget allow.
        team_steps: iterations of a team in all generations, if those after the second take the same
            number of evaluations as the second; without the testing phase.
    """

    evaluations: int
    generations: int
    team_steps: int


def price_of(config: RunConfig, ancestor: State | Team | None = None) -> Price:
    """Return the cost of a run; simulates nothing and loads no kernel.

    Args:
        config: of the run.
        ancestor: as for ``Lab.first_state``.

    Raises:
        UsageError: the budget does not pay for one generation, or the ancestor does not fit.
    """
    world, run = config.build_world(), config.run
    method, layout = config.build_method(), layout_of(world, config.controller)
    check_memory(config, layout)
    state = _first(method, layout, run.seed, ancestor)
    check_budget(method, state, run)
    after = unscored(method, state, run)
    first = after.progress.team_evaluations
    later = min(first, price(method, after, run))  # a first generation may search more widely
    generations = run.generations
    if run.budget_evaluations:
        generations = min(generations, 1 + (run.budget_evaluations - first) // later)
    evaluations, of_fittest = first + (generations - 1) * later, run.plays(layout.n_robots)
    epochs = evaluations * run.epochs
    epochs += generations * of_fittest * (run.fittest_epochs - run.epochs)
    return Price(first, generations, epochs * world.params.iterations)


def _first(method: Method, layout: Layout, seed: int, ancestor: State | Team | None) -> State:
    """Return generation 0 of random populations, of an ancestor's, or bred from its team.

    Raises:
        UsageError: it cannot be kept, its header is not of this run, the ancestor does not fit, or
            the method has parameters that are for another one.
    """
    from conevo.runs.checkpoint import refuse_unkept

    if not isinstance(ancestor, Team):
        refuse_idle(method.config)
    if ancestor is None:
        state = method.init(layout, seed)
    elif isinstance(ancestor, Team):
        state = breed_from(method, layout, seed, ancestor.genes, ancestor.active)
    else:
        state = hand_on(method, layout, seed, ancestor)
    refuse_unkept(state, method.title)
    progress = getattr(state, "progress", None)
    if not isinstance(progress, Progress):
        raise UsageError(f"the state of {method.title} has no progress, made by Progress.first")
    if problem := progress.problem(Progress.first(layout, seed)):
        raise UsageError(f"the first state of {method.title} has a progress with another {problem}")
    return state


def first_team(config: RunConfig) -> Team:
    """Return a team of generation 0 of a run, which no robot has played: it stands for a champion.

    Raises:
        UsageError: as ``price_of``.
    """
    method, layout = config.build_method(), layout_of(config.build_world(), config.controller)
    check_memory(config, layout)
    trials = method.ask(_first(method, layout, config.run.seed, None))
    unknown = np.full(layout.n_robots, np.nan)
    return Team(0, trials.networks()[0], trials.teams[0] >= 0, unknown, unknown)


def refuse_unfit(before: RunConfig, config: RunConfig) -> None:
    """Raise UsageError if the populations of one run cannot be bred from a team of another one."""
    method, layout = config.build_method(), layout_of(config.build_world(), config.controller)
    check_memory(config, layout)
    _first(method, layout, config.run.seed, first_team(before))


def check_memory(config: RunConfig, layout: Layout) -> None:
    """Refuse a run that asks for more memory than this machine has, before any of it is taken.

    Raises:
        EnvironmentFailure: it does; the settings that ask for it are named.
    """
    method, run = config.method_config, config.run
    robots, sizes = layout.n_robots, ("genotypes", "blueprints")
    genotypes, name = max((getattr(method, size, 0), size) for size in sizes)
    # One after another in the team, or several at once, in teams of each round.
    is_systematic = getattr(method, "evaluation", "") == "systematic"
    teams = genotypes * (robots if is_systematic else getattr(method, "rounds", 1))
    if pairs := getattr(method, "pairs", 0):  # of teams, every robot with genes of its own
        name, genotypes, teams = "pairs", pairs, 2 * pairs
    genes = 4 * robots * layout.max_hidden * layout.n_genes * genotypes
    team = 4 * robots * layout.max_hidden * (1 + layout.n_genes)
    needs = {
        f"method.{name} = {genotypes:,}": 3 * genes,  # parents, children, partners
        f"method.{name} = {genotypes:,} in {teams:,} teams": teams * team,
        f"{teams:,} teams and run.epochs = {run.epochs:,}": teams * run.epochs * 40 * robots,
    }
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if sum(needs.values()) > there:
        what = max(needs, key=lambda name: needs[name])
        raise EnvironmentFailure(
            f"this run needs about {sum(needs.values()) / 2**30:,.0f} GiB of memory and the "
            f"machine has {there / 2**30:,.0f}: {what} ask for most of it"
        )


@dataclass(frozen=True)
class Lab:
    """World, method and simulator of one run, with the device that simulates."""

    config: RunConfig
    world: World
    method: Method
    simulator: Simulator
    evaluate: Evaluate
    device: str

    @staticmethod
    def equip(config: RunConfig, threads: int | None, device: str) -> Lab:
        """Build world, method and simulator.

        Args:
            config: of the run.
            threads: CPU threads, all by default.
            device: "auto", "cpu" or "cuda"; the lab's is the one that this is here.

        Raises:
            UsageError: the world's functions cannot be compiled.
            EnvironmentFailure: there is no such device, or no place for compiled kernels.
        """
        world = config.build_world()
        device = device_for(world, device)
        made = simulator(world, config.controller, threads, device)
        return Lab(
            config=config,
            world=world,
            method=config.build_method(),
            simulator=made,
            evaluate=make_evaluator(
                made,
                world,
                seed=config.run.seed,
                epochs=config.run.epochs,
                fittest_epochs=config.run.fittest_epochs,
                credit=config.run.credit,
                scenarios=config.run.scenarios,
            ),
            device=device,
        )

    @property
    def layout(self) -> Layout:
        """The size of the problem."""
        return layout_of(self.world, self.config.controller)

    def refuse_other_team(self, team: Team, path: Path) -> None:
        """Raise DamagedFile if a team, of the run at ``path``, cannot play in this world."""
        layout = self.layout
        fits = (layout.n_robots, layout.max_hidden, layout.n_genes)
        if team.genes.shape != fits:
            raise DamagedFile(
                f"{path}: a team of {team.genes.shape} robots, neurons and genes cannot play "
                f"{self.config.task}, which has {fits}"
            )

    def blank_state(self) -> State:
        """Return generation 0 of random populations, an example of the states of this run."""
        return self.method.init(self.layout, self.config.run.seed)

    def first_state(self, ancestor: State | Team | None = None) -> State:
        """Return the state before generation 0, after checking that the budget pays for it.

        Args:
            ancestor: a state with the initial populations, or a team from which they are bred;
                random populations by default.

        Raises:
            UsageError: the budget does not pay for one generation, the ancestor does not fit, the
                method's state cannot be kept, or the world has no room for its objects.
        """
        layout, seed = self.layout, self.config.run.seed
        check_memory(self.config, layout)
        state = _first(self.method, layout, seed, ancestor)
        check_budget(self.method, state, self.config.run)
        self.world.scenarios([seed])  # raises now if there is no room for its objects
        return state

    def rehearsed(self, first: State) -> State:
        """Return the state before generation 0, after trying a method and a simulator from files.

        A method executes the first generation with made-up scores, a simulator evaluates one team
        in two scenarios.

        Args:
            first: the state before generation 0.

        Raises:
            UsageError: they return something that is not valid.
        """
        if self.config.method_entry.files:
            _refuse_unlike(rehearse(self.method, first), first, self.method.title)
        if isinstance(self.simulator, OwnSimulator):
            trials = self.method.ask(first)
            keys = [fold(self.config.run.seed, "rehearsal", k) for k in range(2)]
            twice = np.repeat(trials.teams[:1], 2, axis=0).astype(np.int32)
            scenarios = self.world.scenarios(keys)
            self.simulator.evaluate(trials.genes, twice, scenarios, rounds=2)
            if self.config.run.credit == "difference":
                self._play_without(trials.genes, twice, scenarios)
        return first

    def _play_without(
        self, genes: FloatArray, teams: npt.NDArray[np.int32], scenarios: Scenarios
    ) -> None:
        """Refuse a simulator that cannot play a robot with an empty network."""
        needs = 'run.credit = "difference" needs robots with an empty network, which the simulator'
        try:
            seen = self.simulator.evaluate(genes, without(teams, 0), scenarios, rounds=2)
        except Exception as error:
            raise UsageError(f"{needs} of {self.world.name} cannot play: {error!r:.200}") from error
        if not np.isfinite(seen.fitness).all():
            raise UsageError(f"{needs} of {self.world.name} gives a fitness that is not finite")


def _refuse_unlike(state: State, first: State, title: str) -> None:
    """Raise UsageError if a state could not be kept, or not be read back.

    Args:
        state: after a generation.
        first: before it.
        title: of the method.
    """
    from conevo.runs.checkpoint import difference, refuse_unkept

    refuse_unkept(state, title)
    if name := difference(state, first):
        raise UsageError(
            f"the state of {title} cannot be kept: after a generation {name} is another kind of "
            f"array or value than at first"
        )
    problem: Any = getattr(state, "problem", lambda _: "")
    if not takes(problem, 1):
        raise UsageError(f"the state of {title} must have problem(first), or none")
    if name := state.progress.problem(first.progress) or problem(first):
        raise UsageError(f"the state of {title} has a wrong {name} after the first generation")


def refuse_other_state(state: State, blank: State, path: Path) -> None:
    """Raise DamagedFile if a state, of the run at ``path``, is not one of its own.

    It begins a generation, and has the types, the dimensions and the seed of the first one.
    """
    from conevo.runs.checkpoint import difference

    problem = (
        difference(state, blank)
        or state.progress.problem(blank.progress)
        or getattr(state, "problem", lambda _: "")(blank)
    )
    if problem:
        raise DamagedFile(f"{path}: {problem} of its checkpoint is not one of this run")
