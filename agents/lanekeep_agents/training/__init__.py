"""Training with Stable-Baselines3: settings, wrappers, checkpoints, the run."""
