"""Passes over long signals: variances, likelihoods, one-step predictions."""
