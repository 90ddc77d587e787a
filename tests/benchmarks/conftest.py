"""What tests of the benchmark share."""

import pytest

from lanekeep_benchmarks import plots


@pytest.fixture
def unpainted(monkeypatch):
    """Pictures are drawn and not painted, which is half of a short run's time, for tests that look at none."""
    monkeypatch.setattr(plots, "png", lambda figure: b"not painted")
