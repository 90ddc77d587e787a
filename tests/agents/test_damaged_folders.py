"""Folders of others, damaged by chance; `tests/fuzz/results.py` draws thousands."""

import pytest

pytest.importorskip("stable_baselines3")
from results import KINDS, Checks

from lanekeep_benchmarks.suites import SUITES


@pytest.fixture(scope="module")
def checks(tmp_path_factory):
    """Whole folders of each kind, which are read."""
    yield Checks(tmp_path_factory.mktemp("whole"))
    del SUITES["fuzzed"]  # other tests list what the package has


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_folders_are_refused_or_read(kind, checks):
    assert checks.damaged(kind, 40, seed=1) == []


def test_what_is_no_file_is_refused(checks):
    assert checks.special() == []
