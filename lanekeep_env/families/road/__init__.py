"""Cars on roads."""
