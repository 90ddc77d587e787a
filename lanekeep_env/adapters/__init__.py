"""Other simulators: each in its own room, which nothing else of the package imports, behind its own extra."""
