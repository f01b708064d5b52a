"""Claims C1 to C3 about all worlds, and the list of all claims.

C1 and C3 are about the exchange of CONE's populations, C2 about specialization without need.

Nitschke 2009, section 7.1.2. The last letter of an id is that of the world.

- Choice: recombination between populations is rare if at most a tenth of the pairs of
  sub-populations that could recombine do so, in the mean of a run's generations.
- Choice: genotypes had to be very similar if the mean threshold of their distance (GST) was at most
  a quarter. Those of independent populations are about a third apart.
- Choice: both are true in an environment if they are in more than half of the runs.
- Choice: "no specialization" means that most champions do not have two castes, in environments that
  do not encourage any according to 5.4.1 and 6.4.1.
"""

from conevo.report.claims.gacc import GACC
from conevo.report.claims.pursuit import PURSUIT
from conevo.report.claims.rover import ROVER
from conevo.report.claims.vocabulary import read_claims

__all__ = ["CLAIMS"]

GENERAL = read_claims("""
C1R (7.1.2) rover: CONE's populations recombine rarely, and genotypes had to be very similar
  has | rare exchange | cone | complex-1..10
  has | similar genotypes | cone | complex-1..10
C1P (7.1.2) pursuit: CONE's populations recombine rarely, and genotypes had to be very similar
  has | rare exchange | cone | team-1..10
  has | similar genotypes | cone | team-1..10
C1G (7.1.2) gacc: CONE's populations recombine rarely, and genotypes had to be very similar
  has | rare exchange | cone | complex-1..9
  has | similar genotypes | cone | complex-1..9
C2R (5.4.1, 7.1.2) rover: CONE develops no castes in simple environments, which need none
  lacks | two castes | cone | simple-1..10
C2G (6.4.1, 7.1.2) gacc: CONE develops no castes in simple environments, which need none
  lacks | two castes | cone | simple-1..10
C3R (7.1.2) rover: with both metrics populations recombine less than without one of them
  above | exchange | cone-1, cone-2 : cone | complex-1..10
C3P (7.1.2) pursuit: with both metrics populations recombine less than without one of them
  above | exchange | cone-1, cone-2 : cone | team-1..10
C3G (7.1.2) gacc: with both metrics populations recombine less than without one of them
  above | exchange | cone-1, cone-2 : cone | complex-1..9
""")

CLAIMS = (*ROVER, *PURSUIT, *GACC, *GENERAL)
"""All 69: 28 of multi-rover, 17 of pursuit-evasion, 16 of gathering, and 8 of section 7.1.2."""
