"""An adapter without its package is one line that names the extra; nothing is imported before."""

from __future__ import annotations

import subprocess
import sys

import pytest

import conevo
from conevo.errors import UsageError

PACKAGES = {"pettingzoo": "pettingzoo", "gymnasium": "gymnasium"}  # of each adapter


@pytest.mark.parametrize("adapter", PACKAGES)
def test_a_missing_package_is_one_line_with_the_extra(
    adapter: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = f"conevo.adapters.{adapter}"
    monkeypatch.delitem(sys.modules, module, raising=False)
    monkeypatch.delitem(vars(conevo.adapters), adapter, raising=False)
    for name in [*sys.modules]:
        if name.partition(".")[0] in ("gymnasium", "pettingzoo"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(UsageError) as refused:
        getattr(conevo.adapters, adapter)
    assert str(refused.value) == (
        f"conevo.adapters.{adapter} needs other packages (gymnasium is not installed): pip install "
        f"'conevo[{adapter}]'"
    )
    assert refused.value.exit_code == 2


def test_an_unknown_adapter_is_an_unknown_attribute() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'petting_zoo'"):
        _ = conevo.adapters.petting_zoo
    assert set(PACKAGES) <= set(dir(conevo.adapters))


def test_no_package_is_imported_before_its_adapter() -> None:
    code = "import sys, conevo, conevo.adapters, conevo.adapters.teams; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"gymnasium", "pettingzoo", "torch", "tensordict", "PIL"} & set(loaded)
    assert "conevo.adapters.teams" in loaded
