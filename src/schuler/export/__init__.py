"""Noise models and trajectories in the formats of other programs."""
