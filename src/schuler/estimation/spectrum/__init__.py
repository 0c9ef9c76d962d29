"""Processes from a power spectral density. Spec 2.2."""
