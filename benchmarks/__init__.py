"""Measurements of speed; each script prints its figures."""
