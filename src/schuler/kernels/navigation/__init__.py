"""Strapdown, error-state filter and smoother: plain functions over structures of arrays."""
