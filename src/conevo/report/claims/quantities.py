"""The quantities that claims are about: one value per run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from conevo.campaigns.tables import Tables
from conevo.report.claims.sensitivity import changed

__all__ = ["QUANTITIES", "Quantity", "Reading"]

RARE = 0.1  # of the pairs of sub-populations that could recombine
SIMILAR_BELOW = 0.25  # distance of genotypes

PLAYED = """
    WITH played AS (
        SELECT s.run, s.team, avg(s.value) AS value
        FROM scores s JOIN runs r USING (run)
        WHERE s.study = '{study}' AND s.measure = {measure} AND s.value IS NOT NULL
        GROUP BY s.run, s.team
    )
"""
LESIONED = """
    SELECT whole.run, {value}
    FROM played whole JOIN played lesioned USING (run)
    WHERE whole.team = 'whole' AND lesioned.team <> 'whole'
    GROUP BY whole.run
"""
BEST = "SELECT run, max(value) FROM played WHERE team {teams} GROUP BY run"
COMPLEMENTARY = (
    PLAYED.format(study="clones", measure="r.measure")
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
CAPTURES = """
    SELECT run, sum(count) FILTER (WHERE behaviour = '{behaviour}') FROM behaviours
    WHERE kind = 'collective' GROUP BY run
"""
MEMBERS = """
    SELECT run, (coalesce(string_agg(behaviour, ' and ' ORDER BY behaviour)
        FILTER (WHERE count > 0), '') = '{behaviours}')::INTEGER
    FROM behaviours WHERE kind = 'member' GROUP BY run
"""
HIDDEN = """
    SELECT run, bool_or(round(g.hidden) = {n})::INTEGER
    FROM generations g JOIN champions c USING (run, generation) GROUP BY run
"""
SIMILAR = f"""
    SELECT run, (avg(gst) <= {SIMILAR_BELOW})::INTEGER FROM generations
    WHERE gst IS NOT NULL GROUP BY run
"""
RARELY = f"SELECT run, (exchange_share <= {RARE})::INTEGER FROM runs"
NO_EXCHANGE = "no exchange between populations"
CASTES = "SELECT run, ({condition})::INTEGER FROM robots GROUP BY run"
HAS_ANY = "bool_or(caste = 'non-specialized')"
SPECIALIZED = "count(DISTINCT caste) FILTER (WHERE caste NOT IN ('non-specialized', 'move'))"
LOSS = "avg((whole.value - lesioned.value) / nullif(greatest(whole.value, lesioned.value), 0))"

Reading = Callable[[Tables], dict[str, float]]


@dataclass(frozen=True)
class Quantity:
    """A value of a run.

    Attributes:
        read: returns it by run, of the runs that have it.
        lacks: the reason for its absence, in words.
        is_share: 1 if something was seen in the run, else 0.
        needs_exchange: whether a value of CONE counts as CONE's only if its populations exchanged;
            not so the performance of one of its robots, nor the exchange itself.
        needs_signal: whether it describes methods only if these select by more than luck; not so
            the exchange itself.
        is_apart: whether its runs have other budgets, such as that of a stage.
    """

    read: Reading
    lacks: str
    is_share: bool = False
    needs_exchange: bool = True
    needs_signal: bool = True
    is_apart: bool = False


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


def _lesioned(value: str, measure: str = "r.measure") -> Quantity:
    played = PLAYED.format(study="lesion", measure=measure)
    return Quantity(_query(played + LESIONED.format(value=value)), "no castes replaced")


def _cloned(teams: str, lacks: str) -> Quantity:
    """Return the best of a run's teams of clones: the performance of one of its robots."""
    played = PLAYED.format(study="clones", measure="r.measure")
    return Quantity(_query(played + BEST.format(teams=teams)), lacks, needs_exchange=False)


def _is(sql: str, lacks: str) -> Quantity:
    """Return whether a condition holds in a run."""
    return Quantity(_query(sql), lacks, is_share=True)


def _castes(condition: str) -> Quantity:
    """Return whether the castes of a team fulfil a condition."""
    return _is(CASTES.format(condition=condition), "no castes recorded")


def _seen(kind: str, behaviour: str) -> Quantity:
    """Return whether a behaviour was seen in a run, "individual" or "collective"."""
    return _is(SEEN.format(kind=kind, behaviour=behaviour), "no behaviours recorded")


def _members(*behaviours: str) -> Quantity:
    """Return whether robots are specialized to these collective behaviours, and others to none."""
    names = " and ".join(sorted(("non-specialized", *behaviours)))
    return _is(MEMBERS.format(behaviours=names), "no members of behaviours recorded")


def _when_shaped(is_shaped: bool) -> Reading:
    """Return the main measure of runs that are stages of a shaping, or of the others."""
    return lambda tables: {
        one.run: one.value for one in tables.values() if ("/stage-" in one.run) == is_shaped
    }


def _exchanged(sql: str, lacks: str, is_share: bool) -> Quantity:
    """Return something about the exchange itself, which no exchange and no signal invalidate."""
    return Quantity(_query(sql), lacks, is_share, needs_exchange=False, needs_signal=False)


COLLECTIVES = ("entrapment", "pursuer-blocker", "spiders-fly", "role-switcher")
QUANTITIES: dict[str, Quantity] = {
    **{name: _tested(name) for name in ("value", "area", "capture_time", "delivered", "path")},
    "share of the optimum": Quantity(_share, "no testing phase"),
    "whole": _lesioned("avg(whole.value)"),
    "lesioned": _lesioned("avg(lesioned.value)"),
    "loss": _lesioned(LOSS),
    "whole area": _lesioned("avg(whole.value)", "'area'"),
    "lesioned area": _lesioned("avg(lesioned.value)", "'area'"),
    "loss of area": _lesioned(LOSS, "'area'"),
    "evolved": Quantity(_performance(None, "clones", "whole"), "no teams of clones"),
    "clones": _cloned("<> 'whole'", "no teams of clones"),
    "clones of a specialist": _cloned(
        "NOT IN ('whole', 'non-specialized')", "no specialist cloned"
    ),
    "clones of med": _cloned("= 'med'", "no med specialist cloned"),
    "clones of hi": _cloned("= 'hi'", "no hi specialist cloned"),
    "clones of the non-specialized": _cloned(
        "= 'non-specialized'", "no non-specialized robot cloned"
    ),
    **{
        f"composed {name}": Quantity(_performance(None, "composed", name), f"no {name} composed")
        for name in COLLECTIVES[1:]
    },
    "complementary": Quantity(_query(COMPLEMENTARY), "no team of two behaviours"),
    "one caste": _castes("count(DISTINCT caste) = 1"),
    "only non-specialized": _castes("bool_and(caste = 'non-specialized')"),
    "two castes": _castes("count(DISTINCT caste) FILTER (WHERE caste <> 'move') >= 2"),
    "several castes": _castes(f"{HAS_ANY} AND {SPECIALIZED} >= 2"),
    "mixed castes": _castes(f"{HAS_ANY} AND {SPECIALIZED} >= 1"),
    "all castes": _castes(f"{HAS_ANY} AND {SPECIALIZED} >= 3"),
    **{f"only {caste}": _castes(f"bool_and(caste = '{caste}')") for caste in ("med", "hi")},
    **{f"some {caste}": _castes(f"bool_or(caste = '{caste}')") for caste in ("low", "med", "hi")},
    **{f"any of {kind}": _castes(f"bool_or(caste LIKE '{kind}-%')") for kind in "ABC"},
    **{
        f"detectors and gatherers of {kind}": _castes(
            f"bool_or(caste = '{kind}-detector') AND bool_or(caste = '{kind}-gatherer')"
        )
        for kind in "ABC"
    },
    **{
        f"constructors of {kind}": _castes(f"bool_or(caste = '{kind}-constructor')")
        for kind in "ABC"
    },
    "idle predators": _seen("individual", "idle"),
    **{behaviour: _seen("collective", behaviour) for behaviour in COLLECTIVES},
    **{
        f"captures by {name}": Quantity(
            _query(CAPTURES.format(behaviour=name)), "no behaviours recorded"
        )
        for name in COLLECTIVES
    },
    "members of nothing": _members(),
    "members of pursuer-blocker and spiders-fly": _members("pursuer-blocker", "spiders-fly"),
    "members of spiders-fly and role-switcher": _members("spiders-fly", "role-switcher"),
    "delivered after shaping": Quantity(_when_shaped(True), "no shaping", is_apart=True),
    "delivered directly": Quantity(_when_shaped(False), "no direct evolution", is_apart=True),
    "change": Quantity(changed, "no runs of changed and unchanged settings"),
    "exchange": _exchanged("SELECT run, exchange_share FROM runs", NO_EXCHANGE, False),
    "rare exchange": _exchanged(RARELY, NO_EXCHANGE, True),
    "similar genotypes": _exchanged(SIMILAR, "no threshold of similarity", True),
    "three hidden neurons": _is(HIDDEN.format(n=3), "no champion recorded"),
}
"""Name -> quantity; ``rover``, ``pursuit`` and ``gacc`` have the claims that use them.

value, area, capture_time, delivered: of the testing phase. share of the optimum: of the world's
main measure, in [0, 1]. whole, lesioned: of the lesion study, the latter the mean over castes.
loss: (whole - lesioned) over the larger of them, mean over castes, in [-1, 1]. Choice: so it is the
share of the team's performance that is lost, as in tables 4.5, 5.7 and 6.9, and where a team gains
it cannot be beyond all bounds; a team that never achieves anything has none. evolved, clones: of
the clones study, the latter the best team of clones. complementary: evolved, of teams with at least
two behaviours. The others are 1 or 0; castes are those of ``robots``: several are two specialized
ones and the non-specialized, mixed one and it, all three and it.
"""
