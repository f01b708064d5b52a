"""The claims of the thesis, each judged by the tables of a campaign."""

from conevo.report.claims.catalogue import CLAIMS
from conevo.report.claims.judgement import Verdict, verdicts
from conevo.report.claims.statements import Claim

__all__ = ["CLAIMS", "Claim", "Verdict", "verdicts"]
