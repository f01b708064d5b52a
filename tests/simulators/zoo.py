"""A task with PettingZoo's interface: robots count up to a number; some leave, others draw."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete
from pettingzoo import ParallelEnv


class raw_env(ParallelEnv):
    """Walkers w_0 .. and a guard: a walker observes a start and its place; a step is 0, 1 or 2.

    Args:
        noise: where random numbers come from: its "own", also counting "earlier" epochs, the
            "process", or the "clock".
        leaves: iteration in which the first walker leaves, -1 for never.
        crash: its "exit", "error" or "sys.exit" in the second step of an epoch; of "tries" also in
            those that conevo plays before a run.
        wrong: its mistake in the second step: the guard's observation is "long", or "text", or it
            has "no observation" or "no reward".
        agents: their names.
    """

    metadata: dict[str, Any] = {"name": "zoo", "is_parallelizable": True}  # noqa: RUF012

    def __init__(
        self,
        noise: str = "own",
        leaves: int = -1,
        crash: str = "",
        wrong: str = "",
        agents: Any = ("w_0", "w_1", "guard"),
    ) -> None:
        self.noise, self.leaves, self.crash, self.wrong = noise, leaves, crash, wrong
        self.possible_agents = list(agents)
        self.used = 0

    def observation_space(self, agent: str) -> Any:
        box = Box(-np.inf, np.inf, (2,), np.float32)
        return box if agent == "guard" else Dict({"all": box, "turn": Discrete(2)})

    def action_space(self, agent: str) -> Any:
        return Box(-1, 1, (1, 2)) if agent == "guard" else Discrete(3, start=5)

    def drawn(self) -> float:
        if self.noise == "process":
            return float(np.random.random())  # noqa: NPY002
        return time.perf_counter() % 1 if self.noise == "clock" else float(self.rng.random())

    def reset(self, seed: int | None = None, options: Any = None) -> Any:
        self.used += self.noise == "earlier"
        self.seed, self.rng = seed, np.random.default_rng([seed or 0, self.used])
        self.agents, self.t = list(self.possible_agents), 0
        self.x = {name: self.drawn() for name in self.agents}
        return self.observed(), {}

    def observed(self) -> Any:
        seen = {name: np.array([x, self.drawn()], np.float32) for name, x in self.x.items()}
        return {
            name: seen[name] if name == "guard" else {"all": seen[name], "turn": self.t % 2}
            for name in self.agents
        }

    def step(self, actions: Any) -> Any:
        self.t += 1
        if self.crash and self.t == 2 and (self.seed > 2 or "tries" in self.crash):
            if "sys" in self.crash:
                sys.exit("no more")
            if "exit" in self.crash:
                os._exit(7)
            raise ValueError("no more\nfood")
        assert set(actions) == set(self.agents)
        for name, action in actions.items():
            assert self.action_space(name).contains(action), (name, action)
            self.x[name] += float(action[0, 0]) if name == "guard" else (action - 5) / 8
        gone = [name for name in self.agents if name == "w_0" and self.t == self.leaves]
        if self.t == 12:
            gone = list(self.agents)
        rewards = {name: self.x[name] + self.x["guard"] for name in self.agents}
        ended = {name: name in gone for name in self.agents}
        seen = self.observed()
        if self.wrong and self.t == 2:
            match self.wrong:
                case "long":
                    seen["guard"] = np.zeros(7, np.float32)
                case "text":
                    seen["guard"] = np.array(["near", "far"])
                case "no observation":
                    del seen["guard"]
                case "no reward":
                    del rewards["guard"]
        self.agents = [name for name in self.agents if name not in gone]
        return seen, rewards, ended, dict.fromkeys(ended, False), {name: {} for name in ended}


parallel_env = raw_env
