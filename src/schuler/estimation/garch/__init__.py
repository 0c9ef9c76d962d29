"""GARCH(p, q) and the variances it claims, alone or behind an ARMA. Spec 5.2."""
