"""Students that learn from a teacher who knows the road to its end and the true car, without a gradient."""
