"""Who has not installed what environments need is told what to install."""

import importlib
import sys

import pytest


def test_a_missing_package_is_named_with_the_extra_that_brings_it(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("epuck_sim.environments")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(ModuleNotFoundError, match=r'pip install "epuck-sim\[learning\]"$'):
        importlib.import_module("epuck_sim.environments")
