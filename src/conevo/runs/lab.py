"""The working parts of a run, made from its configuration."""

from __future__ import annotations

from dataclasses import dataclass

from conevo.evolution.inheritance import hand_on
from conevo.evolution.methods.registry import METHODS
from conevo.evolution.protocol import Layout, Method, State
from conevo.runs.config import RunConfig
from conevo.runs.evaluation import Evaluate, make_evaluator
from conevo.runs.loop import check_budget
from conevo.worlds.protocol import World
from conevo.worlds.rollout import Rollout

__all__ = ["Lab"]


@dataclass(frozen=True)
class Lab:
    """World, method and simulator of one run."""

    config: RunConfig
    world: World
    method: Method
    rollout: Rollout
    evaluate: Evaluate

    @staticmethod
    def equip(config: RunConfig, threads: int | None, device: str) -> Lab:
        """Build world, method and simulator.

        Raises:
            EnvironmentFailure: there is no such device.
        """
        world = config.build_world()
        rollout = Rollout(world, n_threads=threads, device=device)
        return Lab(
            config=config,
            world=world,
            method=METHODS[config.method].build(config.method_config),
            rollout=rollout,
            evaluate=make_evaluator(
                rollout,
                world,
                seed=config.run.seed,
                epochs=config.run.epochs,
                fittest_epochs=config.run.fittest_epochs,
                credit=config.run.credit,
            ),
        )

    def first_state(self, ancestor: State | None = None) -> State:
        """Return the state before generation 0, after checking that it can be paid.

        Args:
            ancestor: whose populations to begin with; random ones by default.

        Raises:
            UsageError: the budget does not pay for one generation, the ancestor does not fit, or
                the world has no room for what belongs in it.
        """
        spec, seed = self.world.controller, self.config.run.seed
        layout = Layout(self.world.n_robots, spec.n_hidden, spec.max_hidden, spec.n_genes)
        if ancestor is None:
            state = self.method.init(layout, seed)
        else:
            state = hand_on(self.method, layout, seed, ancestor)
        check_budget(self.method, state, self.config.run.budget_evaluations)
        self.world.scenarios([seed])  # says so now if there is no room for what belongs in it
        return state
