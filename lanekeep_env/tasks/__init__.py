"""What a task asks: start states, costs and the end of an episode, as pure scalar functions."""
