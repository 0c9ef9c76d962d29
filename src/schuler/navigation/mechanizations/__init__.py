"""Several IMUs in one filter: synthetic, extended, constrained, system level."""
