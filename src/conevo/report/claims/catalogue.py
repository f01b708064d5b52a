"""The 69 claims of the thesis (Nitschke 2009, chapters 4 to 7), one by one."""

from __future__ import annotations

from conevo.report.claims.gacc import GACC
from conevo.report.claims.general import GENERAL
from conevo.report.claims.pursuit import PURSUIT
from conevo.report.claims.rover import ROVER
from conevo.report.claims.statements import Claim

__all__ = ["CLAIMS"]

CLAIMS: tuple[Claim, ...] = (*ROVER, *PURSUIT, *GACC, *GENERAL)
"""28 of multi-rover, 17 of pursuit-evasion, 16 of gathering, and 8 of section 7.1.2."""
