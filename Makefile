# The same steps by hand and in .ci/run. Use an active virtual environment, or name one: make test PYTHON=.venv/bin/python
PYTHON ?= python

.PHONY: help install format lint types test smoke bench speed same ci
help:
	@echo "make install | format | lint | types | test | smoke | bench | speed | ci"
	@echo "make same OLD=another checkout: whether both drive equal episodes"

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

# For large changes of form: episodes equal another checkout's bit for bit. OLD=../old
same:
	$(PYTHON) tests/same_episodes.py $(OLD)

ci:
	bash .ci/run
