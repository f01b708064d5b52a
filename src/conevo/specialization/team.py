"""Measures of a whole team's specialization: those of the thesis, of biology, of robot teams.

``METRICS`` names them for reports and pages; ``measure`` takes them all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.specialization.diversity import (
    caste_entropy,
    differences,
    hierarchic_social_entropy,
    system_neural_diversity,
)
from conevo.specialization.entropy import activity_entropy, division_of_labour, mutual_information
from conevo.specialization.favourite import (
    affinity,
    favourite_share,
    mean_where_defined,
    portion_devoted,
)
from conevo.specialization.individual import NON_SPECIALIZED, relative_degree
from conevo.specialization.switching import switching_index
from conevo.terms import S_SCALE

__all__ = ["METRICS", "Activity", "Metric", "measure"]


@dataclass(frozen=True)
class Activity:
    """Activity of the robots of a team.

    Attributes:
        counts: [R, A] how often each robot executed each action.
        specialization: [R] degree of specialization S of each robot.
        labels: [R] caste of each robot.
        independent: [R] the S that independent draws from its own shares would give.
        settings: columns of the counts among which a robot chooses (``World.settings``).
    """

    counts: npt.NDArray[Any]
    specialization: npt.NDArray[np.floating[Any]]
    labels: Sequence[str]
    independent: npt.NDArray[np.floating[Any]]
    settings: Sequence[int]

    @property
    def work(self) -> npt.NDArray[Any]:
        """How often each robot used each setting, [R, K]."""
        return self.counts[:, list(self.settings)]


@dataclass(frozen=True)
class Metric:
    """One measure.

    Attributes:
        function: computes it; None where it is not defined.
        span: its range, for R robots, A actions and K settings.
        what: its meaning, and that of its extremes.
        source: the publication that defines it.
    """

    function: Callable[[Activity], float | None]
    span: str
    what: str
    source: str


METRICS: dict[str, Metric] = {
    "specialization": Metric(
        lambda team: float(np.mean(team.specialization)),
        "0 to 1",
        f"mean degree of specialization S, switches over possible ones; {S_SCALE}",
        "Nitschke 2009, eq. 3.4",
    ),
    "specialized": Metric(
        lambda team: float(np.mean([name != NON_SPECIALIZED for name in team.labels])),
        "0 to 1",
        "portion of the robots that are specialized",
        "Nitschke 2009, 3.2.3",
    ),
    "independent_specialization": Metric(
        lambda team: float(np.mean(team.independent)),
        "0 to 1 - 1 / A",
        "mean S of independent draws from each robot's own shares; 0: one action each",
        "1 - sum of p squared, the null of eq. 3.4",
    ),
    "relative_specialization": Metric(
        lambda team: float(np.mean(relative_degree(team.specialization, team.independent))),
        "0 to 9 / 4",
        "S over that of independent draws, mean; 0: always the same action, 1: as if drawn, "
        "above: in turn",
        "eq. 3.4 over its null",
    ),
    "favourite_setting": Metric(
        lambda team: mean_where_defined(favourite_share(team.work)),
        "1 / K to 1",
        "share of the favourite in the settings that a robot used, mean; 1: always the same one, "
        "1 / K: all equally often; not detected by S",
        "after Nitschke 2009, 5.2: one of three settings",
    ),
    "affinity": Metric(
        lambda team: mean_where_defined(affinity(team.work)),
        "0 to 1",
        "share of the favourite setting less that of the next, mean; 1: always the same one",
        "Murciano et al. 1997, after section 2.3",
    ),
    "devoted": Metric(
        lambda team: portion_devoted(team.work),
        "0 to 1",
        "portion of the robots with more than half of their work in one setting",
        "O'Donnell and Jeanne 1990",
    ),
    "favourite_action": Metric(
        lambda team: mean_where_defined(favourite_share(team.counts)),
        "1 / A to 1",
        "share of time in a robot's favourite action, mean; 1: all its time on one",
        "Solow and Szmerekovsky, section 2.3",
    ),
    "switching_index": Metric(
        lambda team: switching_index(team.specialization, team.counts.shape[1]),
        "-1 / (A - 1) to 1",
        "1: nobody switches; 0: as often as by chance; below: more often",
        "Gautrais et al. 2002",
    ),
    "activity_entropy": Metric(
        lambda team: activity_entropy(team.counts),
        "0 to log2 A bits",
        "a robot's own entropy of actions, mean; 0: each does one thing only",
        "O'Donnell and Jeanne 1990",
    ),
    "caste_entropy": Metric(
        lambda team: caste_entropy(team.labels),
        "0 to log2 R bits",
        "entropy of castes; 0: one caste",
        "Balch 1997",
    ),
    "mutual_information": Metric(
        lambda team: mutual_information(team.counts),
        "0 to log2 min(R, A) bits",
        "between robots and actions; 0: all divide their work alike",
        "Gorelick et al. 2004",
    ),
    "division_by_action": Metric(
        lambda team: division_of_labour(team.counts)[0],
        "0 to 1",
        "mutual information over the entropy of actions; 1: one action a robot",
        "Gorelick et al. 2004",
    ),
    "division_by_robot": Metric(
        lambda team: division_of_labour(team.counts)[1],
        "0 to 1",
        "mutual information over the entropy of robots; 1: one robot an action",
        "Gorelick et al. 2004",
    ),
    "hierarchic_social_entropy": Metric(
        lambda team: hierarchic_social_entropy(differences(team.counts)),
        "0 to log2 R bits",
        "entropy of clusters over all levels of difference; 0: all divide their work alike",
        "Balch 2000",
    ),
    "system_neural_diversity": Metric(
        lambda team: system_neural_diversity(differences(team.counts)),
        "0 to 1",
        "mean difference of two robots; 0: all divide their work alike",
        "Bettini et al. 2023",
    ),
}


def measure(team: Activity) -> dict[str, float | None]:
    """Return every measure of ``METRICS``; None where one is not defined."""
    return {name: metric.function(team) for name, metric in METRICS.items()}
