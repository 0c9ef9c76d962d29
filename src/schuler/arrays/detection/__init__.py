"""Faults of redundant sensors: found, put on an axis or a unit, excluded, readmitted."""
