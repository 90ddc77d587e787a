"""In which order the tests run."""


def pytest_collection_modifyitems(items):
    """Begin with the long files, so that no process drives one alone at the end (Makefile: `test`)."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)
