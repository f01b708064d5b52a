"""Claims P1 to P10: pursuit-evasion.

Nitschke 2009, sections 4.5 and 4.6, appendix A.

- Choice: one prey and two are compared between team types with equally many predators.
- Choice: a behaviour emerges in a run if its champion makes one capture by it; the share is that of
  a method's runs of all team types together. A run may show several: the thesis' shares sum to more
  than 100 %.
- Choice: idle predators appear in a team type if more than a fifth of CONE's champions have one,
  and do not if fewer have.
- Choice: an exception (types 1, 6, 7 of P4) claims nothing about what is excepted.
- Choice: complementary are evolved teams with predators of at least two behaviours; of each run's
  teams of clones the best stands for all, and methods are pooled (figure 4.12 names none).
- Choice: table 4.5 has one number for all team types, so P10 compares their runs together.
"""

from __future__ import annotations

from conevo.analysis.claims.cases import (
    METHODS,
    ONE_PREY,
    OTHERS,
    TEAMS,
    TWO_PREY,
    VARIANTS,
    about,
    teams,
)
from conevo.analysis.claims.statements import (
    Claim,
    Compare,
    Part,
    Sample,
    above,
    across,
    alike,
    within,
)

__all__ = ["PURSUIT"]

IDLE = teams(4, 5, 8, 9, 10)  # where the thesis saw idle predators, and CONE above the others
NOT_IDLE = teams(1, 2, 3, 6, 7)
SOME = 0.2  # of the runs

PURSUIT: tuple[Claim, ...] = (
    Claim(
        "P1",
        "capture time of CONE above all others for team types 4, 5, 8, 9, 10",
        "4.5.6",
        "pursuit",
        (Part(above("capture_time", IDLE, ("cone",), OTHERS)),),
    ),
    Claim(
        "P2",
        "alike for team types 1, 2, 3, 6, 7",
        "4.5.6",
        "pursuit",
        (Part(alike("capture_time", NOT_IDLE, [("cone", other) for other in OTHERS])),),
    ),
    Claim(
        "P3",
        "two prey (types 6-10) are held shorter than one (1-5), every method",
        "4.5.5",
        "pursuit",
        (Part(across("capture_time", METHODS, zip(ONE_PREY, TWO_PREY, strict=True))),),
    ),
    Claim(
        "P4",
        "CONE above CONE-1, -2, -3 except for types 1, 6, 7",
        "4.5.7",
        "pursuit",
        (Part(above("capture_time", teams(2, 3, 4, 5, 8, 9, 10), ("cone",), VARIANTS)),),
    ),
    Claim(
        "P5",
        "entrapment emerges in about 80 % of HomCNE and HetCNE runs",
        "4.5.1",
        "pursuit",
        about("entrapment", TEAMS, {"homcne": 0.8, "hetcne": 0.8}),
    ),
    Claim(
        "P6",
        "pursuer-blocker in about 65 % (CCGA) and 70 % (MESP)",
        "4.5.2",
        "pursuit",
        about("pursuer-blocker", TEAMS, {"ccga": 0.65, "mesp": 0.7}),
    ),
    Claim(
        "P7",
        "spiders-fly in about 40 / 35 / 50 % (CCGA / MESP / CONE)",
        "4.5.3",
        "pursuit",
        about("spiders-fly", TEAMS, {"ccga": 0.4, "mesp": 0.35, "cone": 0.5}),
    ),
    Claim(
        "P8",
        "role-switcher in about 80 % of CONE runs; idle predators appear in types 4, 5, 8, 9, 10 "
        "only",
        "4.5.4, 4.5.6",
        "pursuit",
        (
            *about("role-switcher", TEAMS, {"cone": 0.8}),
            Part(tuple(within("idle predators", "cone", (e,), SOME, 1) for e in IDLE)),
            Part(tuple(within("idle predators", "cone", (e,), 0, SOME) for e in NOT_IDLE)),
        ),
    ),
    Claim(
        "P9",
        "teams of complementary behaviours hold the prey longer than cloned teams (types 1-5)",
        "4.6.5",
        "pursuit",
        (
            Part(
                tuple(
                    Compare(
                        "above",
                        Sample("complementary", METHODS, (e,)),
                        Sample("clones", METHODS, (e,)),
                    )
                    for e in ONE_PREY
                )
            ),
        ),
        caution="the teams of figure 4.12 were composed by hand; these evolved",
    ),
    Claim(
        "P10",
        "replacing specialized predators hurts CONE teams most (table 4.5)",
        "4.6.6",
        "pursuit",
        (
            Part(
                tuple(
                    Compare(
                        "above", Sample("loss", ("cone",), TEAMS), Sample("loss", (other,), TEAMS)
                    )
                    for other in OTHERS
                )
            ),
        ),
        caution="its other half, least in HomCNE and HetCNE, is contradicted by table 4.5",
    ),
)
