"""ARMA(p, q) by exact maximum likelihood. Spec 5.1."""
