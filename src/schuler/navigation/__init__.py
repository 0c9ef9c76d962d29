"""Alignment, strapdown, error model, aiding, filter, smoother: from recordings to a trajectory."""
