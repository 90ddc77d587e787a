"""What differs between kinds of worlds; a family fills in the engine's step."""
