"""Noise from the drive itself, by the likelihood of the innovations."""
