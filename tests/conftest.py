"""In which order the tests run, and on how many threads."""

import os

# Two processes run tests on two cores: further threads of BLAS and torch only wait for each other, which takes four to
# six times as long where matrices are small. Set before NumPy is imported, and for what tests start.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_collection_modifyitems(items):
    """Begin with the long files, so that no process drives one alone at the end (Makefile: `test`)."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
