"""Redundant axes followed sample by sample: fusion, parity, faults."""
