"""Every method learns a separable function through ask and tell, without a world."""

from dataclasses import fields

import numpy as np
import pytest

from conevo.evolution import METHODS, Layout, Scores, method

LAYOUT = Layout(n_robots=3, n_hidden=3, max_hidden=3, n_genes=5)

CASES = [
    *((name, {"genotypes": 60}, 40) for name in ("homcne", "hetcne")),
    *((name, {"pairs": 50}, 40) for name in ("cone-es", "hom-es")),
    *(("openai-es", {"pairs": 50, "team": team}, 40) for team in ("clones", "whole", "robots")),
    *(("cma-es", {"form": form, "team": "clones"}, 40) for form in ("full", "separable")),
    ("cma-es", {"team": "whole"}, 40),
    *((name, {"team": team}, 60) for name in ("esp", "cosyne") for team in ("clones", "whole")),
    ("novelty", {"genotypes": 60, "weight": 0.0, "team": "clones"}, 40),
    ("map-elites", {"genotypes": 60, "team": "clones"}, 40),
    *(("sane", {"team": team}, 60) for team in ("clones", "whole")),
    *(
        (name, {"genotypes": 20, "evaluation": evaluation, "rounds": 5}, 40)
        for name, entry in METHODS.items()
        if "evaluation" in {field.name for field in fields(entry.config_class)}
        for evaluation in ("systematic", "shared")
    ),
]


@pytest.mark.parametrize(("name", "config", "generations"), CASES)
def test_error_halves(name, config, generations):
    target = np.random.default_rng(0).uniform(-1, 1, (3, 3, 5))
    if name in ("homcne", "hetcne", "hom-es") or config.get("team") == "clones":
        target[:] = target[0]  # clones can only learn one target
    if "genotypes" in config and name != "map-elites":
        config = config | {"elite_portion": 0.25}
    learner = method(name, **config)
    state = learner.init(LAYOUT, root=11)
    error = []
    while state.progress.generation < generations:
        trials = learner.ask(state)
        distance = np.abs(trials.networks() - target).mean(axis=(2, 3))
        before = state.progress.generation
        # Robots differ in S and in their actions by more than any threshold: no two are similar.
        specialization = np.broadcast_to([0.0, 0.5, 1.0], distance.shape)
        shares = np.broadcast_to(np.eye(3), (*distance.shape, 3))
        state = learner.tell(state, trials, Scores(1 - distance, specialization, shares))
        if state.progress.generation > before:
            error.append((1 - state.progress.fittest_fitness).mean())
    assert np.mean(error[-3:]) < error[0] / 2
