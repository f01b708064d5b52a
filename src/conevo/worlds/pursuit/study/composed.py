"""Teams composed of predators of several behaviours, by the number of predators.

Nitschke 2009, section 4.6.5, figure 4.12. An entrapment team consists of clones, so it is not here.
Choice: of six predators the role-switcher has one idle: 4.6.5 lists seven, two of them idle.
"""

from __future__ import annotations

__all__ = ["COMPOSED", "roles_of"]

_PURSUERS_BLOCKERS = {
    2: {"pursuer": 1, "blocker": 1},
    3: {"pursuer": 2, "blocker": 1},
    4: {"pursuer": 2, "blocker": 2},
    5: {"pursuer": 3, "blocker": 2},
    6: {"pursuer": 3, "blocker": 3},
}
COMPOSED = {
    "pursuer-blocker": _PURSUERS_BLOCKERS,
    "spiders-fly": _PURSUERS_BLOCKERS,
    "role-switcher": {
        2: {"flanker": 1, "knocker": 1},
        3: {"flanker": 2, "knocker": 1},
        4: {"flanker": 2, "knocker": 1, "idle": 1},
        5: {"flanker": 2, "knocker": 2, "idle": 1},
        6: {"flanker": 2, "knocker": 3, "idle": 1},
    },
}
"""Collective behaviour -> number of predators -> number of each individual behaviour."""


def roles_of(collective: str, n_predators: int) -> list[str]:
    """Return each predator's individual behaviour; nothing if no such team exists."""
    of = COMPOSED[collective].get(n_predators, {})
    return [role for role, n in of.items() for _ in range(n)]
