"""Methods by name, and the one clear line for a wrong one."""

import os
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import conevo.evolution
from conevo.errors import UsageError
from conevo.evolution import METHODS, method

OURS = ("cone-es", "hom-es")


def test_the_five_methods_and_three_variants():
    published = ["homcne", "hetcne", "ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3"]
    assert [name for name in METHODS if name in published] == published


def test_variants_have_a_family():
    families = {name: METHODS[name].family for name in METHODS if METHODS[name].family != name}
    assert families == {"cone-1": "cone", "cone-2": "cone", "cone-3": "cone", "hom-es": "cone-es"}


@pytest.mark.parametrize("name", METHODS)
def test_an_entry_builds_its_method(name):
    entry = METHODS[name]
    built = method(name)
    assert (built.name, built.title) == (entry.name, entry.title)
    assert type(built.config) is entry.config_class
    assert is_dataclass(built.config)
    size = "pairs" if name in (*OURS, "openai-es") else "genotypes"
    assert size in {field.name for field in fields(entry.config_class)}
    with pytest.raises(AttributeError):
        setattr(built.config, size, 3)
    assert entry.summary
    assert entry.source.startswith("conevo's own") == (name in OURS)
    assert re.search(r"\b(19|20)\d\d\b", entry.source)


@pytest.mark.parametrize(
    ("name", "config", "message"),
    [
        ("cones", {}, "unknown method 'cones'; did you mean 'cone'?"),
        ("mesp", {"genotype": 3}, "unknown key 'method.genotype'; did you mean 'method.genotypes'"),
        ("homcne", {"evaluation": "shared"}, "unknown key 'method.evaluation'"),
        ("mesp", {"genotypes": 1}, "method.genotypes = 1: must be greater than or equal to 2"),
        ("mesp", {"genotypes": 2.5}, "method.genotypes = 2.5: must be a valid integer"),
        ("mesp", {"genotypes": True}, "method.genotypes = True: must be a valid integer"),
        ("cone", {"elite_portion": 0}, "method.elite_portion = 0: must be greater than 0"),
        ("cone", {"sst": 1.5}, "method.sst = 1.5: must be less than or equal to 1"),
        ("cone", {"sst": float("nan")}, "method.sst = nan: must be a finite number"),
        ("cone", {"gd_aggregate": "max"}, "gd_aggregate = 'max': must be 'mean' or 'sum'"),
        ("cone-1", {"use_gdm": True}, "method.use_gdm = True: must be False"),
        ("cone-es", {"genotypes": 4}, "unknown key 'method.genotypes'"),
        ("cone-es", {"pairs": 1}, "method.pairs = 1: must be greater than or equal to 2"),
        ("cone-es", {"spread": 0}, "method.spread = 0: must be greater than 0"),
        ("hom-es", {"individual": 0.5}, "method.individual = 0.5: must be less than or equal to 0"),
        (
            "openai-es",
            {"team": "both"},
            "method.team = 'both': must be 'clones', 'whole' or 'robots'",
        ),
        ("openai-es", {"share": 1.1}, "method.share = 1.1: must be less than or equal to 1"),
        ("cma-es", {"form": "half"}, "method.form = 'half': must be 'full' or 'separable'"),
        (
            "cone-es",
            {"pairs": 52, "rounds": 5},
            "method.rounds = 5: must divide the 52 pairs evenly",
        ),
    ],
)
def test_wrong_requests(name, config, message):
    with pytest.raises(UsageError) as caught:
        method(name, **config)
    assert message in str(caught.value)


def test_reading_names_loads_no_numpy():
    source = Path(conevo.evolution.__file__).parents[2]
    code = (
        "import sys; from conevo.evolution import METHODS; print(*METHODS);"
        "sys.exit('numpy' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(source)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.split() == list(METHODS)
    assert done.returncode == 0, done.stderr
