"""The language of the claims' tables, on rows written out by hand."""

import pytest

from conevo.report.claims.statements import Claim, Compare, Part, Sample, Within
from conevo.report.claims.vocabulary import part_of, read_claims


def compared(expect, a, b):
    return Compare(expect, *(Sample(what, (method,), (place,)) for what, method, place in (a, b)))


def test_every_sample_with_every_other_or_in_order():
    assert part_of("above | value | cone : CNE | complex-1").statements == (
        compared("above", ("value", "cone", "complex-1"), ("value", "homcne", "complex-1")),
        compared("above", ("value", "cone", "complex-1"), ("value", "hetcne", "complex-1")),
    )
    assert part_of("alike | whole : lesioned | mesp | team-1..2 ~ team-6..7").statements == (
        compared("alike", ("whole", "mesp", "team-1"), ("lesioned", "mesp", "team-6")),
        compared("alike", ("whole", "mesp", "team-2"), ("lesioned", "mesp", "team-7")),
    )
    two = part_of("alike | area | two of COEVOLUTION | simple-3 | need 1")
    assert two.need == 1
    assert [(one.a.methods[0], one.b.methods[0]) for one in two.statements] == [
        ("ccga", "mesp"),
        ("ccga", "cone"),
        ("mesp", "cone"),
    ]


def test_a_sample_may_pool_methods_and_environments():
    (one,) = part_of("above | complementary : clones | {ISOLATED} | {team-1, team-3..4}").statements
    places = ("team-1", "team-3", "team-4")
    assert one.a == Sample("complementary", ("ccga", "mesp"), places)
    assert one.b == Sample("clones", ("ccga", "mesp"), places)


def test_shares_and_means_in_a_range():
    cone, mesp = (Sample("value", (name,), ("complex-5",)) for name in ("cone", "mesp"))
    in_range = part_of("within | value | cone, mesp | complex-5 | -0.25..0.25")
    assert in_range == Part((Within(cone, -0.25, 0.25), Within(mesp, -0.25, 0.25)))
    near = part_of("about | value | cone, mesp | complex-5 | 0.5, 0.7")
    assert near == Part((Within(cone, 0.4, 0.6), Within(mesp, 0.7 - 0.1, 0.7 + 0.1)))
    assert part_of("has | value | cone | complex-5") == Part((Within(cone, 0.5, 1),))
    assert part_of("lacks | value | cone | complex-5") == Part((Within(cone, 0, 0.5),))


def test_a_claim_has_its_rows_and_attributes():
    table = """
P0 (4.1, 4.2) what is claimed of
      predators
  has | one caste | cone
      | team-1
  caution: in part
      only
R0 (5.1) another
"""
    assert read_claims(table) == (
        Claim(
            "P0",
            "what is claimed of predators",
            "4.1, 4.2",
            (Part((Within(Sample("one caste", ("cone",), ("team-1",)), 0.5, 1),)),),
            caution="in part only",
        ),
        Claim("R0", "another", "5.1", ()),
    )


@pytest.mark.parametrize(
    "row",
    [
        "above | value | cone : mesp",
        "alike | value | cone : mesp | complex-1 | 9 of 10",
        "alike | value | CNE ~ cone | complex-1",
        "about | value | cone, mesp | complex-1 | 0.1, 0.2, 0.3",
        "within | value | cone | complex-1",
    ],
)
def test_a_wrong_row_is_refused(row):
    with pytest.raises(ValueError, match=r"values|int|float|longer|shorter"):
        part_of(row)


def test_a_wrong_head_is_refused():
    with pytest.raises(ValueError, match="not a claim: R1 without a source"):
        read_claims("R1 without a source\n  has | one caste | cone | team-1\n")
