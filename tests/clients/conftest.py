"""Which client drives which environment: each file its share of the ids, so that a new id has a client by itself."""

from __future__ import annotations

from pathlib import Path

import pytest

from lanekeep_env.registration import ENVIRONMENTS

_CLIENTS = sorted(file.name for file in Path(__file__).parent.glob("*/test_*.py"))


def pytest_generate_tests(metafunc):
    """``env_id`` is every n-th id, where n files share them."""
    if "env_id" in metafunc.fixturenames:
        first = _CLIENTS.index(Path(metafunc.module.__file__).name)
        metafunc.parametrize("env_id", list(ENVIRONMENTS)[first :: len(_CLIENTS)])


@pytest.fixture(autouse=True)
def one_thread(tmp_path, monkeypatch):
    """Small networks gain nothing by threads; what clients write goes to a folder that is thrown away."""
    import torch

    torch.set_num_threads(1)
    monkeypatch.chdir(tmp_path)
