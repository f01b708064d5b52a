"""What the thesis claims, held against the tables of a campaign, claim by claim."""

from conevo.report.claims.catalogue import CLAIMS
from conevo.report.claims.judgement import Verdict, verdicts
from conevo.report.claims.statements import Claim

__all__ = ["CLAIMS", "Claim", "Verdict", "verdicts"]
