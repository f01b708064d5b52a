"""Each claim against tables with known truth: true, reversed, cut short."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from conevo.campaigns.tables import Tables
from conevo.report.claims import CLAIMS, Claim, Verdict, outcomes, verdicts
from conevo.report.statistics import Comparison, compare
from report.claims.known_truth import METHODS, TRUTHS, Truth, of_robots, write_tables

BY_ID = {claim.id: claim for claim in CLAIMS}
CONTRADICTORY = {"R6", "R20", "P11", "P16", "P17", "G8", "G15"}  # by the thesis itself
ALIKE = {"R2", "R4", "R6", "R8", "R20", "R21", "P2", "G3", "G15"}  # claims that something is
BY_PLAN = {"R22", "P15", "G12", "G14"}  # judged by factors of their own plan
DECIDED = {"R5", "R18", "G2", "G5"}  # by the world
CAUTIOUS = {"R1", "R9", "R10", "R21", "R24", "P9", "P10", "P12", "P13", "G6", "G11"}
OF_RUNS = {"value", "area", "capture_time", "delivered", "share of the optimum", "path", "exchange"}
OF_RUNS |= {"rare exchange", "similar genotypes", "three hidden neurons"}  # all without studies
Change = Callable[[Truth], None]


def change(
    environments: Iterable[str], methods: str | Iterable[str], /, **values: object
) -> Change:
    """Return a function that sets attributes of the cells of these environments and methods."""
    names = methods.split() if isinstance(methods, str) else list(methods)
    places = list(environments)

    def apply(truth: Truth) -> None:
        for environment in places:
            for method in names:
                cell = truth[environment, method]
                truth[environment, method] = dataclasses.replace(cell, **values)  # type: ignore[arg-type]

    return apply


def teams(*numbers: int) -> list[str]:
    return [f"team-{n}" for n in numbers]


ALL_TEAMS = teams(*range(1, 11))
COMPLEX_9 = [f"complex-{n}" for n in range(1, 10)]
SIMPLE = [f"simple-{n}" for n in range(1, 11)]

# One change that makes the claim wrong, and a part of the resulting verdict.
WRONG: dict[str, tuple[Change, str]] = {
    "R1": (change(["complex-3"], "mesp", value=4000), "complex-3 value, CONE - MESP"),
    "R2": (change(["complex-3", "complex-8"], "mesp", value=3400), "complex-8 value, CCGA - MESP"),
    "R3": (change(["complex-9"], "hetcne", value=2600), "complex-9 value, CCGA - HetCNE"),
    "R4": (change(["simple-7"], "homcne", value=1600), "simple-7 value, HomCNE - HetCNE"),
    "R5": (change(["simple-2"], "ccga", value=2500), "complex-2 - simple-2 value, CCGA"),
    "R6": (change(SIMPLE, "cone", area=0.6), "simple-1 area, HomCNE - CONE"),
    "R7": (change(["extended-5"], "ccga", value=3500), "extended-5 value, CONE - CCGA"),
    "R8": (change(["extended-9"], "mesp", value=1000), "extended-9 value, MESP - HomCNE"),
    "R9": (change(["complex-4"], "cone", several=0.0), "complex-4 several castes, CONE"),
    "R10": (change(["simple-6"], "hetcne", several=0.9), "simple-6 one caste, HetCNE"),
    "R11": (change(["complex-1"], "mesp", loss=0.6), "complex-1 loss, CONE - MESP"),
    "R12": (
        change(["complex-7"], "cone", clones=0.8),
        "complex-7 evolved, CCGA - clones of a spec",
    ),
    "R13": (change(["complex-2"], "cone-2", value=3500), "complex-2 value, CONE - CONE-2"),
    "R14": (change(["simple-3"], "mesp", several=0.9), "simple-3 two castes, MESP"),
    "R15": (change(["complex-9"], "ccga", castes=("hi", "med")), "complex-9 mixed castes, CCGA"),
    "R16": (
        change(["complex-5"], "ccga", castes=("low", "med", "hi")),
        "complex-5 some low, CCGA",
    ),
    "R17": (change(["complex-7"], "homcne", castes=("med",)), "complex-7 only hi, HomCNE"),
    "R18": (change(["complex-8"], "mesp", value=3600), "complex-10 - complex-8 value, MESP"),
    "R19": (change(["complex-10"], "cone", value=5000), "complex-10 value, CONE"),
    "R20": (
        change(["complex-2"], "homcne", value=1900),
        "complex-2 clones of med, CONE - evolved, HomCNE",
    ),
    "R21": (change(["complex-8"], "mesp", area=0.6), "complex-8 area, HomCNE - MESP"),
    "R23": (
        change(["complex-6"], "cone", castes=("low", "hi", "non-specialized")),
        "complex-6 all castes, CONE",
    ),
    "R24": (change(["extended-7"], "hetcne", area=0.5), "extended-7 area, CCGA - HetCNE"),
    "R25": (change(["complex-1"], "mesp", loss=0.6), "complex-1 loss of area, CONE - MESP"),
    "R26": (change(["extended-4"], "homcne", several=0.9), "extended-4 one caste, HomCNE"),
    "R27": (change(["complex-2"], "cone-3", area=0.4), "complex-2 area, CONE - CONE-3"),
    "R28": (change(["complex-4"], "hetcne", area=0.6), "complex-10 - complex-4 area, HetCNE"),
    "P1": (change(["team-9"], "ccga", value=300), "team-9 capture_time, CONE - CCGA"),
    "P2": (change(["team-6"], "cone", value=300), "team-6 capture_time, CONE - HomCNE"),
    "P3": (change(["team-10"], "hetcne", value=500), "team-5 - team-10 capture_time, HetCNE"),
    "P4": (change(["team-2"], "cone-3", value=400), "team-2 capture_time, CONE - CONE-3"),
    "P5": (change(ALL_TEAMS, "hetcne", seen={"entrapment": 0.5}), "entrapment, HetCNE"),
    "P6": (change(ALL_TEAMS, "mesp", seen={"pursuer-blocker": 1.0}), "pursuer-blocker, MESP"),
    "P7": (change(ALL_TEAMS, "cone", seen={"spiders-fly": 0.8}), "spiders-fly, CONE"),
    "P8": (change(["team-3"], "cone", idle=0.9), "team-3 idle predators, CONE"),
    "P9": (change(["team-4"], METHODS, clones=1.2), "team-4 complementary, all methods - clones"),
    "P10": (change(ALL_TEAMS, "ccga", loss=0.6), "loss, CONE - CCGA"),
    "P11": (
        change(["team-3"], "mesp", members=("pursuer-blocker",)),
        "team-3 members of pursuer-blocker and spiders-fly, MESP",
    ),
    "P12": (
        change(["team-3"], "homcne", seen={}),
        "team-3 - team-1 captures by entrapment, HomCNE",
    ),
    "P13": (
        change(["team-4"], METHODS, composed=0.4),
        "team-4 composed pursuer-blocker, all methods - clones, all methods",
    ),
    "P14": (change(["shaping-5"], "mesp", value=900), "shaping-5 path, CONE - MESP"),
    "P16": (
        change(["team-1"], "cone", seen={"role-switcher": 1.0}),
        "team-1 role-switcher, CONE",
    ),
    "P17": (change(ALL_TEAMS, "hetcne", loss=0.45), "loss, CCGA - HetCNE"),
    "G1": (change(["complex-9"], "ccga", value=0.95), "complex-9 delivered, CONE - CCGA"),
    "G2": (
        change(["simple-4"], "mesp", value=0.9),
        "complex-4 - simple-4 share of the optimum, MESP",
    ),
    "G3": (change(["complex-5"], "homcne", value=0.4), "complex-5 delivered, HomCNE - HetCNE"),
    "G4": (change(COMPLEX_9, "cone", value=0.8), "complex-1 to complex-9 share of the opt"),
    "G5": (change(SIMPLE, "hetcne", value=0.3), "simple-1 to simple-10 share of the opt"),
    "G6": (change(["complex-8"], "cone", several=0.0), "complex-8 several castes, CONE"),
    "G7": (change(["complex-6"], "mesp", loss=0.5), "complex-6 loss, CONE - MESP"),
    "G8": (change(["complex-3"], "cone", mixed=0.4), "complex-3 evolved, HomCNE - clones, CONE"),
    "G9": (change(["complex-1"], "cone-1", value=0.93), "complex-1 delivered, CONE - CONE-1"),
    "G10": (
        change(["complex-2"], "hetcne", castes=("A-detector",)),
        "complex-2 only non-specialized, HetCNE",
    ),
    "G11": (
        change(["complex-7"], "ccga", castes=(*of_robots("ccga", 7), "C-detector")),
        "complex-7 any of C, CCGA",
    ),
    "G13": (change(["complex-5"], "homcne", loss=0.45), "complex-5 loss, CCGA - HomCNE"),
    "G15": (change(["complex-1"], "cone", mixed=0.1), "complex-1 clones of the non-specialized"),
    "G16": (change(["complex-3"], "mesp", several=0.0), "complex-3 two castes, MESP"),
    "C1R": (change(["complex-4"], "cone", gst=0.4), "complex-4 similar genotypes, CONE"),
    "C1P": (change(["team-9"], "cone", exchange_share=0.3), "team-9 rare exchange, CONE"),
    "C1G": (change(["complex-9"], "cone", exchange_share=0.3), "complex-9 rare exchange, CONE"),
    "C2R": (change(["simple-9"], "cone", several=1.0), "simple-9 two castes, CONE"),
    "C2G": (change(["simple-2"], "cone", several=1.0), "simple-2 two castes, CONE"),
    "C3R": (change(["complex-4"], "cone-1", exchange_share=0.01), "exchange, CONE-1 - CONE"),
    "C3P": (change(["team-1"], "cone-2", exchange_share=0.01), "exchange, CONE-2 - CONE"),
    "C3G": (change(["complex-2"], "cone-2", exchange_share=0.01), "exchange, CONE-2 - CONE"),
}


def truth_of(claim: Claim) -> Truth:
    """Return the true cells that a claim is about."""
    make = TRUTHS[claim.world][1]
    about = {
        (environment, method)
        for part in claim.parts
        for statement in part.statements
        for sample in statement.samples
        for environment in sample.environments
        for method in sample.methods
    }
    return {key: cell for key, cell in make().items() if key in about}


def claims_of(world: str) -> list[Claim]:
    """Return the claims that are true together in the thesis: G15 contradicts G8."""
    return [c for c in CLAIMS if c.world == world and c.id not in BY_PLAN | {"G15"}]


def marked(identity: str, alone: str) -> str:
    """Return the marked verdict of a claim with this result of the runs."""
    if identity in CONTRADICTORY:
        return "not judged: the thesis contradicts itself"
    return "decided by the world" if identity in DECIDED else alone


def judged(folder: Path, claim: Claim, truth: Truth, n: int | None = None) -> Verdict:
    """Judge a claim by tables with these cells, and with studies only if it is about them."""
    world = TRUTHS[claim.world][0]
    has_studies = not OF_RUNS.issuperset(
        sample.quantity
        for part in claim.parts
        for statement in part.statements
        for sample in statement.samples
    )
    n = n or (20 if world == "pursuit-v2" else 10)
    write_tables(folder, world, truth, n, studies=has_studies)
    with Tables(folder) as tables:
        (verdict,) = verdicts(tables, [claim])
    return verdict


@pytest.fixture(scope="module", autouse=True)
def compared_once() -> Iterator[None]:
    """Compare each pair of samples once: most occur in many of these tests."""
    known: dict[tuple[bytes, bytes], Comparison] = {}

    def once(a: npt.ArrayLike, b: npt.ArrayLike) -> Comparison:
        key = np.asarray(a, dtype=float).tobytes(), np.asarray(b, dtype=float).tobytes()
        if key not in known:
            known[key] = compare(a, b)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outcomes, "compare", once)
        yield


@pytest.fixture(scope="module", params=list(TRUTHS))
def as_claimed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    world, make = TRUTHS[request.param]
    n = 20 if request.param == "pursuit" else 10
    return write_tables(tmp_path_factory.mktemp("claims") / request.param, world, make(), n)


def test_every_claim_is_listed_once_with_its_source() -> None:
    ids = [
        f"{world}{n}"
        for world, last in (("R", 28), ("P", 17), ("G", 16))
        for n in range(1, last + 1)
    ]
    ids += ["C1R", "C1P", "C1G", "C2R", "C2G", "C3R", "C3P", "C3G"]
    assert [claim.id for claim in CLAIMS] == ids
    assert list(WRONG) == [identity for identity in ids if identity not in BY_PLAN]
    chapters = {"R": "5.", "P": "4.", "G": "6.", "C": ("5.", "6.", "7.1.2")}
    assert all(claim.source.startswith(chapters[claim.id[0]]) for claim in CLAIMS)
    assert len({claim.text for claim in CLAIMS}) == len(CLAIMS)


def test_all_are_reproduced_if_all_are_true(as_claimed: Path) -> None:
    with Tables(as_claimed) as tables:
        found = verdicts(tables, claims_of(as_claimed.name))
    assert {one.id: one.alone for one in found} == {one.id: "reproduced" for one in found}
    assert {one.id: one.verdict for one in found} == {
        one.id: marked(one.id, "reproduced") for one in found
    }
    for one in found:
        assert one.effect
        assert one.low is not None
        assert one.high is not None
        assert one.low <= one.high
        assert one.budget.startswith("smoke, about 50,000 team evaluations")
        held = len(one.cells)
        assert one.why.partition("; power: ")[0] == f"{held} of {held} hold"
        assert (one.power is not None) == ("power" in one.why) == (one.id in ALIKE)


@pytest.mark.parametrize("identity", WRONG)
def test_a_claim_is_not_reproduced_if_one_fact_is_reversed(identity: str, tmp_path: Path) -> None:
    truth = truth_of(BY_ID[identity])
    apply, told = WRONG[identity]
    apply(truth)
    verdict = judged(tmp_path, BY_ID[identity], truth)
    assert verdict.alone == "not reproduced"
    assert told in verdict.why
    assert verdict.verdict == marked(identity, "not reproduced")
    assert bool(verdict.caution) == (identity in CONTRADICTORY | DECIDED | CAUTIOUS)


FURTHER = [
    ("R2", change(["complex-8"], "mesp", value=3400), "reproduced"),  # nine of ten are enough
    ("R6", change(SIMPLE[:9], "cone", area=0.6), "reproduced"),  # eleven of twenty are most
    ("R8", change(["extended-1"], "mesp", value=3000), "reproduced"),
    ("R8", change(["extended-1", "extended-2"], "mesp", value=3000), "not reproduced"),
    ("R11", change(["complex-5"], "homcne", loss=0.0), "not reproduced"),
    ("R11", change(["complex-2"], "hetcne", loss=0.4), "not reproduced"),
    ("R12", change([f"complex-{n}" for n in range(1, 11)], "cone", mixed=1.5), "reproduced"),
    ("R14", change(["complex-3"], "ccga", several=0.0), "not reproduced"),
    ("R16", change(["complex-2"], "mesp", castes=("med", "hi")), "not reproduced"),
    ("R16", change(["complex-9"], "ccga", castes=("med", "hi")), "not reproduced"),
    ("R17", change(["complex-2"], "hetcne", castes=("med",)), "not reproduced"),
    ("R20", change(["complex-9"], "hetcne", value=1900), "not reproduced"),
    ("R25", change(["complex-2"], "hetcne", loss=0.4), "not reproduced"),
    ("R26", change(["extended-2"], "ccga", castes=("low", "move")), "not reproduced"),
    ("P11", change(["team-2"], "hetcne", members=("entrapment",)), "not reproduced"),
    ("P11", change(["team-4"], "cone", members=("spiders-fly",)), "not reproduced"),
    ("P14", change(["shaping-6"], "cone", hidden=5.0), "not reproduced"),
    ("P14", change(["shaping-5"], "cone", hidden=5.0), "reproduced"),
    ("P16", change(["team-1"], "mesp", seen={"pursuer-blocker": 0.8}), "not reproduced"),
    ("G10", change(["simple-3"], "homcne", several=1.0), "not reproduced"),
    ("G11", change(["complex-1"], "mesp", castes=("C-detector", "C-gatherer")), "not reproduced"),
    ("G11", change(["complex-9"], "ccga", castes=("A-detector",)), "not reproduced"),
    ("G15", change(COMPLEX_9, "cone", mixed=0.305 / 0.93), "reproduced"),
    ("G16", change(["complex-3"], "homcne", castes=("A-detector", "B-detector")), "not reproduced"),
    ("C1R", change(["complex-1"], "cone", exchange_share=0.3), "not reproduced"),
    ("C1R", change(["complex-1"], "cone", exchanges=0.0, exchange_share=0.0), "reproduced"),
    ("P8", change(ALL_TEAMS, "cone", seen={"role-switcher": 0.4}), "not reproduced"),
    ("P8", change(["team-8"], "cone", idle=0.0), "not reproduced"),
]


@pytest.mark.parametrize(("identity", "apply", "expected"), FURTHER)
def test_each_part_counts(identity: str, apply: Change, expected: str, tmp_path: Path) -> None:
    truth = truth_of(BY_ID[identity])
    apply(truth)
    assert judged(tmp_path, BY_ID[identity], truth).alone == expected


@pytest.mark.parametrize("identity", sorted({*WRONG} - {"P16", "G15"}))  # only one cell; not true
def test_a_claim_is_undecided_if_environments_are_missing(identity: str, tmp_path: Path) -> None:
    claim = BY_ID[identity]
    truth = truth_of(claim)
    statement = claim.parts[0].statements[0]
    is_pair = len(statement.samples) == 2 and len({s.environments for s in statement.samples}) == 2
    kept = statement.environments if is_pair else statement.environments[:1]
    all_places = {e for p in claim.parts for s in p.statements for e in s.environments}
    # An environment that is compared with others counts if these exist.
    pairs = [
        statement.environments
        for part in claim.parts
        for statement in part.statements
        if len({sample.environments for sample in statement.samples}) == 2
    ]
    there = [e for e in kept if all(set(pair) <= set(kept) for pair in pairs if e in pair)]
    few = {key: cell for key, cell in truth.items() if key[0] in kept}
    verdict = judged(tmp_path, claim, few)
    assert verdict.alone == f"undecided: {len(there)} of {len(all_places)} environments"
    assert "no runs of" in verdict.why


@pytest.mark.parametrize("name", TRUTHS)
def test_a_claim_is_undecided_if_two_runs_scatter_widely(name: str, tmp_path: Path) -> None:
    world, truth = TRUTHS[name][0], TRUTHS[name][1]()
    truth = {key: dataclasses.replace(cell, exchange_share=0.05) for key, cell in truth.items()}
    if name == "pursuit":  # pooled environments have more runs: make the differences smaller
        change(ALL_TEAMS, METHODS, loss=0.35)(truth)
        change(ALL_TEAMS, METHODS, clones=0.9, composed=0.9)(truth)
    with Tables(write_tables(tmp_path, world, truth, n=2, noise=0.8)) as tables:
        found = verdicts(tables, claims_of(name))
    assert {one.id: one.alone for one in found} == {
        one.id: "undecided: n too small" for one in found
    }
    compared = [one for one in found if one.tests.startswith("t-test") and one.n == "2"]
    assert all("Mann-Whitney tests can become significant" in one.why for one in compared)
    assert len(compared) == {"rover": 19, "pursuit": 6, "prey": 1, "gacc": 8}[name]


def test_a_claim_is_undecided_without_a_run(tmp_path: Path) -> None:
    world, make = TRUTHS["pursuit"]
    write_tables(tmp_path, world, {key: make()[key] for key in [("team-1", "homcne")]}, n=1)
    with Tables(tmp_path) as tables:
        found = verdicts(tables)
    about = {
        claim.id
        for claim in CLAIMS
        for part in claim.parts
        for statement in part.statements
        for sample in statement.samples
        if claim.world == "pursuit"
        and "homcne" in sample.methods
        and "team-1" in sample.environments
    }
    assert about == {"P2", "P3", "P5", "P9", "P10", "P12", "P17"}
    without = [one for one in found if one.id not in about]
    for one in without:
        assert one.verdict == "undecided: no such runs"
        assert (one.effect, one.n, one.budget, one.low) == ("", "0", "", None)


# Without CONE, or with it among all methods; C1 and C3 are about exchange itself.
WITHOUT_CONE = {
    "R2",
    "R4",
    "R8",
    "R10",
    "R15",
    "R16",
    "R17",
    "R20",
    "R21",
    "R24",
    "P5",
    "P6",
    "P9",
    "P13",
    "G3",
    "G10",
}
WITHOUT_CONE |= {f"C{n}{world}" for n in (1, 3) for world in "RPG"}


@pytest.mark.parametrize("name", TRUTHS)
def test_a_claim_is_not_tested_if_cone_hardly_exchanged(name: str, tmp_path: Path) -> None:
    world, make = TRUTHS[name]
    truth = {key: dataclasses.replace(cell, exchanges=0.3) for key, cell in make().items()}
    with Tables(write_tables(tmp_path, world, truth, n=20 if name == "pursuit" else 10)) as tables:
        found = {one.id: one for one in verdicts(tables, claims_of(name))}
    for identity, one in found.items():
        is_free = identity in WITHOUT_CONE
        assert one.alone == ("reproduced" if is_free else "not tested: no exchange"), identity
        assert ("not tested: no exchange between populations" in one.why) != is_free


def test_a_contradiction_without_cone_stays_one_without_exchange(tmp_path: Path) -> None:
    truth = truth_of(BY_ID["R3"])
    truth = {key: dataclasses.replace(cell, exchanges=0.0) for key, cell in truth.items()}
    change(["complex-9"], "hetcne", value=2600)(truth)
    assert judged(tmp_path, BY_ID["R3"], truth, n=20).verdict == "not reproduced"


@pytest.mark.parametrize(
    ("exchanges", "share", "is_tested"),
    [
        (0.9, 0.09, False),
        (1.0, 0.01, True),
        (0.5, 0.1, True),
        (0.0, 0.0, False),
        (99.0, 0.99, True),
    ],
)
def test_exchange_is_rare_below_one_pair_and_a_tenth(
    exchanges: float, share: float, is_tested: bool, tmp_path: Path
) -> None:
    truth = truth_of(BY_ID["R7"])
    truth = {
        key: dataclasses.replace(cell, exchanges=exchanges, exchange_share=share)
        for key, cell in truth.items()
    }
    verdict = judged(tmp_path, BY_ID["R7"], truth, n=20).verdict
    assert verdict == ("reproduced" if is_tested else "not tested: no exchange")
