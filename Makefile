# The same steps by hand and in .ci/run. Use an active virtual environment, or name one: make test PYTHON=.venv/bin/python
PYTHON ?= python

.PHONY: help install format lint types test smoke bench speed same metrics ci
help:
	@echo "make install | format | lint | types | test | smoke | bench | speed | ci"
	@echo "make same OLD=another checkout: whether both drive equal episodes, equally fast | metrics: sizes of the code"

install:
	$(PYTHON) -m pip install -e ".[test]" -c constraints.txt

format:
	$(PYTHON) -m ruff check --fix .
	$(PYTHON) -m ruff format .

lint:
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .

types:
	$(PYTHON) -m mypy

test:
	$(PYTHON) -m pytest -n 2

# The built wheel with its light core alone, in a virtual environment of its own, outside the repository.
smoke:
	PYTHON="$(PYTHON)" bash .ci/smoke

bench:
	$(PYTHON) -m lanekeep_benchmarks bench

speed:
	$(PYTHON) -m lanekeep_benchmarks speed

# For large changes of form: episodes equal another checkout's bit for bit, and pass as fast. OLD=../old
same:
	$(PYTHON) tests/same_episodes.py $(OLD)
	$(PYTHON) tests/same_speed.py $(OLD)

metrics:
	$(PYTHON) tests/code_metrics.py

ci:
	bash .ci/run
