"""What is known of single runs, one value each: the quantities that claims are about."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from conevo.analysis.frames import Tables

__all__ = ["QUANTITIES", "Quantity", "Reading"]

PLAYED = """
    WITH played AS (
        SELECT s.run, s.team, avg(s.value) AS value
        FROM scores s JOIN runs r USING (run)
        WHERE s.study = '{study}' AND s.measure = r.measure AND s.value IS NOT NULL
        GROUP BY s.run, s.team
    )
"""
LESIONED = (
    PLAYED.format(study="lesion")
    + """
    SELECT whole.run, {value}
    FROM played whole JOIN played lesioned USING (run)
    WHERE whole.team = 'whole' AND lesioned.team <> 'whole'
    GROUP BY whole.run
"""
)
CLONED = PLAYED.format(study="clones") + "SELECT run, max(value) FROM played WHERE team NOT IN "
COMPLEMENTARY = (
    PLAYED.format(study="clones")
    + """
    SELECT run, value FROM played WHERE team = 'whole' AND run IN (
        SELECT run FROM behaviours
        WHERE kind = 'individual' AND behaviour <> 'non-specialized' AND count > 0
        GROUP BY run HAVING count(DISTINCT behaviour) >= 2
    )
"""
)
SEEN = """
    SELECT run, bool_or(kind = '{kind}' AND behaviour = '{behaviour}' AND count > 0)::INTEGER
    FROM behaviours GROUP BY run
"""
CASTES = "SELECT run, ({condition})::INTEGER FROM robots GROUP BY run"
SEVERAL_CASTES = (
    "bool_or(caste = 'non-specialized') AND "
    "count(DISTINCT caste) FILTER (WHERE caste NOT IN ('non-specialized', 'move')) >= 2"
)
LOSS = "avg((whole.value - lesioned.value) / nullif(greatest(whole.value, lesioned.value), 0))"

Reading = Callable[[Tables], dict[str, float]]


@dataclass(frozen=True)
class Quantity:
    """Something that is known of a run.

    Attributes:
        read: returns it by run, of the runs that have it.
        lacks: what a run without it lacks, in words.
        is_share: 1 if something was seen in the run, else 0.
        needs_exchange: whether a value of CONE's is one of CONE only if its populations exchanged;
            not so what one of its robots does, and what was exchanged.
    """

    read: Reading
    lacks: str
    is_share: bool = False
    needs_exchange: bool = True


def _performance(measure: str | None, study: str, team: str) -> Reading:
    return lambda tables: {one.run: one.value for one in tables.values(measure, study, team)}


def _query(sql: str) -> Reading:
    return lambda tables: {
        run: float(value)
        for run, value in tables.query(sql)[1]
        if value is not None and math.isfinite(value)
    }


def _tested(measure: str) -> Quantity:
    return Quantity(_performance(measure, "test", "champion"), "no testing phase")


def _share(tables: Tables) -> dict[str, float]:
    return {one.run: one.value / one.optimum for one in tables.values() if one.optimum}


def _collective(behaviour: str) -> Quantity:
    read = _query(SEEN.format(kind="collective", behaviour=behaviour))
    return Quantity(read, "no behaviours recorded", is_share=True)


QUANTITIES: dict[str, Quantity] = {
    "value": _tested("value"),
    "area": _tested("area"),
    "capture_time": _tested("capture_time"),
    "delivered": _tested("delivered"),
    "share of the optimum": Quantity(_share, "no testing phase"),
    "whole": Quantity(_query(LESIONED.format(value="avg(whole.value)")), "no castes replaced"),
    "lesioned": Quantity(
        _query(LESIONED.format(value="avg(lesioned.value)")), "no castes replaced"
    ),
    "loss": Quantity(_query(LESIONED.format(value=LOSS)), "no castes replaced"),
    "evolved": Quantity(_performance(None, "clones", "whole"), "no teams of clones"),
    "clones": Quantity(
        _query(CLONED + "('whole') GROUP BY run"), "no teams of clones", needs_exchange=False
    ),
    "clones of a specialist": Quantity(
        _query(CLONED + "('whole', 'non-specialized') GROUP BY run"),
        "no specialist cloned",
        needs_exchange=False,
    ),
    "complementary": Quantity(_query(COMPLEMENTARY), "no team of two behaviours"),
    "one caste": Quantity(
        _query(CASTES.format(condition="count(DISTINCT caste) = 1")),
        "no castes recorded",
        is_share=True,
    ),
    "several castes": Quantity(
        _query(CASTES.format(condition=SEVERAL_CASTES)), "no castes recorded", is_share=True
    ),
    "idle predators": Quantity(
        _query(SEEN.format(kind="individual", behaviour="idle")),
        "no behaviours recorded",
        is_share=True,
    ),
    **{
        behaviour: _collective(behaviour)
        for behaviour in ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher")
    },
}
"""Name -> what it is; ``rover``, ``pursuit`` and ``gacc`` say what claims make of them.

value, area, capture_time, delivered: of the testing phase. share of the optimum: of the world's
main measure, in [0, 1]. whole, lesioned: of the lesion study, the latter the mean over castes.
loss: (whole - lesioned) over the larger of them, mean over castes, in [-1, 1]. Choice: so it is the
share of the team's performance that is lost, as in tables 4.5, 5.7 and 6.9, and where a team gains
it cannot be beyond all bounds; a team that never achieves anything has none. evolved, clones: of
the clones study, the latter the best team of clones. complementary: evolved, of teams with at least
two behaviours. The others are 1 or 0.
"""
