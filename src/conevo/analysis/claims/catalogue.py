"""The 32 claims of the thesis (Nitschke 2009, chapters 4 to 6), one by one."""

from __future__ import annotations

from conevo.analysis.claims.gacc import GACC
from conevo.analysis.claims.pursuit import PURSUIT
from conevo.analysis.claims.rover import ROVER
from conevo.analysis.claims.statements import Claim

__all__ = ["CLAIMS"]

CLAIMS: tuple[Claim, ...] = (*ROVER, *PURSUIT, *GACC)
"""In the order of ids: 13 of multi-rover, 10 of pursuit-evasion, 9 of gathering."""
