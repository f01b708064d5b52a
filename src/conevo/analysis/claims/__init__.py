"""What the thesis claims, held against the tables of a campaign, claim by claim."""

from conevo.analysis.claims.catalogue import CLAIMS
from conevo.analysis.claims.judgement import Verdict, verdicts
from conevo.analysis.claims.statements import Claim

__all__ = ["CLAIMS", "Claim", "Verdict", "verdicts"]
