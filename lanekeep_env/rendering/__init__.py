"""Pictures of environments: what happens, at a glance. Needs the extra ``render`` (pygame-ce)."""
