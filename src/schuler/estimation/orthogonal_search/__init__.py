"""Fast Orthogonal Search for linear and cross-product terms. Spec 4."""
