"""The tables of a campaign: their columns, for writers and readers."""

import re

__all__ = ["SCHEMA"]

_COLUMNS = {
    "runs": """
        run VARCHAR, task VARCHAR, world VARCHAR, environment VARCHAR, family VARCHAR,
        number INTEGER, method VARCHAR, title VARCHAR, preset VARCHAR, seed BIGINT,
        variant VARCHAR, generations INTEGER, planned_evaluations BIGINT, evaluations BIGINT,
        team_steps BIGINT, seconds DOUBLE, core_seconds DOUBLE, stopped_by VARCHAR,
        measure VARCHAR, optimum DOUBLE, n_robots INTEGER, exchanges DOUBLE,
        exchange_share DOUBLE, run_id VARCHAR, conevo VARCHAR, code VARCHAR, changes VARCHAR,
        numpy VARCHAR, warp VARCHAR, kernel_hash VARCHAR
    """,
    "measures": """
        run VARCHAR, measure VARCHAR, unit VARCHAR, larger_is_better BOOLEAN, low DOUBLE,
        high DOUBLE
    """,
    "scores": """
        run VARCHAR, study VARCHAR, team VARCHAR, measure VARCHAR, scenario INTEGER, value DOUBLE
    """,
    "champions": """
        run VARCHAR, generation INTEGER, finalists INTEGER, measure VARCHAR, selection DOUBLE,
        validation DOUBLE, test DOUBLE, ratio DOUBLE
    """,
    "generations": """
        run VARCHAR, generation INTEGER, evaluations BIGINT, team_steps BIGINT, value DOUBLE,
        fitness DOUBLE, specialization DOUBLE, sst DOUBLE, gst DOUBLE, recombinations INTEGER,
        type_c_evaluations INTEGER, hidden DOUBLE
    """,
    "castes": "run VARCHAR, generation INTEGER, caste VARCHAR, robots INTEGER",
    "robots": """
        run VARCHAR, robot INTEGER, caste VARCHAR, specialization DOUBLE, fitness DOUBLE,
        hidden INTEGER, favourite_setting VARCHAR, setting_share DOUBLE, affinity DOUBLE,
        favourite_action VARCHAR, action_share DOUBLE, independent DOUBLE, relative DOUBLE
    """,
    "actions": "run VARCHAR, robot INTEGER, action VARCHAR, count BIGINT",
    "metrics": "run VARCHAR, metric VARCHAR, value DOUBLE",
    "signal": """
        run VARCHAR, unit VARCHAR, generation VARCHAR, genotypes INTEGER, trials INTEGER,
        icc DOUBLE, standard_error DOUBLE, low DOUBLE, high DOUBLE, scheme INTEGER,
        icc_of_scheme DOUBLE, low_of_scheme DOUBLE, high_of_scheme DOUBLE, rounds_for_half DOUBLE
    """,
    "behaviours": "run VARCHAR, kind VARCHAR, behaviour VARCHAR, count INTEGER",
}

SCHEMA: dict[str, dict[str, str]] = {
    table: dict(re.findall(r"(\w+) (\w+)", columns)) for table, columns in _COLUMNS.items()
}
"""Columns of each table and their DuckDB types, as written to and read from NAME.parquet.

``runs``: one row for each run or stage of a shaping. Two stages of one task, the first evolved by
another method, are one run: generations, evaluations and team_steps are counted through both, here
and in ``generations``; method and champion are the second's, generation 0 is the first's. title is
the method's name as published; planned_evaluations is a run's budget of team evaluations, NULL
without one; evaluations is the number it spent; exchanges is the number of pairs of sub-populations
that recombined between populations, the mean over generations; exchange_share is its share of the
pairs that could have; both are NULL for methods that never do. ``robots``: specialization is S,
independent the S of independent draws from the robot's shares, relative S over that; a share is 1
if it is always the same; columns from favourite_setting on are NULL in studies of earlier versions.
``signal``: see ``studies.signal.measure_signal``; icc is of one trial, scheme is the number of
trials that the method gives each genotype; NULL where all fitness was the same. ``measures``: the
world's, as it declares them; for one that is not listed, larger is better.
"""
