# The same steps by hand and in .ci/run. Use an active virtual environment, or name one: make test PYTHON=.venv/bin/python
PYTHON ?= python

.PHONY: help install format lint types test slow smoke compat clients lowest bench speed tables notebooks docs same metrics fuzz own ci
help:
	@echo "make install | format | lint | types | test | smoke | compat | clients | lowest | bench | speed | tables | notebooks | docs | ci"
	@echo "make same OLD=another checkout: whether both drive equal episodes, equally fast | metrics: sizes of the code"
	@echo "make slow: the large draws of what the tests draw smaller"
	@echo "make own FOLDER=of road files and maps: whether each loads and is driven, or why it is refused"
	@echo "make fuzz: 10,000 random scenarios, 3,000 damaged files of each kind (half an hour)"

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

# A file's tests run in one process, so that what they share is made once.
test:
	$(PYTHON) -m pytest -n 2 --dist loadfile --no-loadscope-reorder

slow:
	$(PYTHON) -m pytest -n 2 --dist loadfile -m slow

# The built wheel with its light core alone, in a virtual environment of its own, outside the repository.
smoke:
	PYTHON="$(PYTHON)" bash .ci/smoke

# A part of the tests (which: .ci/compat) with the lowest versions that are admitted and with the newest; Python 3.11.
compat:
	PYTHON="$(PYTHON)" bash .ci/compat

# Other people's trainers (tests/clients), each kind in a virtual environment of its own.
clients:
	PYTHON="$(PYTHON)" bash .ci/clients

# constraints-lowest.txt anew after a bound has changed; needs uv. Resolved as for macOS, where torch brings no CUDA
# packages; the other pins are the same on Linux.
lowest:
	MACOSX_DEPLOYMENT_TARGET=14.0 uv pip compile pyproject.toml --extra test --resolution lowest-direct \
		--python-version 3.11 --python-platform macos --constraint constraints-newest.txt --no-annotate \
		--custom-compile-command "make lowest" --quiet --output-file constraints-lowest.txt

bench:
	$(PYTHON) -m lanekeep_benchmarks bench

speed:
	$(PYTHON) -m lanekeep_benchmarks speed

# The tables of results in README and pages, and the scores on the environments' pages, measured anew.
tables:
	$(PYTHON) docs/tables.py README.md docs/benchmark.md
	$(PYTHON) docs/scores.py docs/scores.json

# The notebooks of docs/notebooks with their output; needs the extra docs.
notebooks:
	$(PYTHON) docs/run_notebooks.py build/notebooks

# The site, into build/site, to read from disk; needs the extra docs. Notebooks are run that are older than
# themselves or the packages; make notebooks runs all. (The variable: Material's word on MkDocs 2.)
docs:
	$(PYTHON) docs/build_site.py build/docs
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet --config-file build/docs/mkdocs.yml

# For large changes of form: episodes equal another checkout's bit for bit, and pass as fast. OLD=../old
same:
	$(PYTHON) tests/same_episodes.py $(OLD)
	$(PYTHON) tests/same_speed.py $(OLD)

metrics:
	$(PYTHON) tests/code_metrics.py

# Slow: what is drawn here is drawn smaller in the tests.
fuzz:
	$(PYTHON) tests/fuzz/scenarios.py --count 10000
	$(PYTHON) tests/fuzz/places.py --count 3000
	$(PYTHON) tests/fuzz/policies.py --count 3000
	$(PYTHON) tests/fuzz/results.py --count 3000

# Other people's roads and maps: each is driven to its end, or refused in one line.
own:
	$(PYTHON) tests/own_files.py $(FOLDER)

ci:
	bash .ci/run
