"""Panels of --help, in the order in which they are shown; below them all, what is rarely needed."""

from __future__ import annotations

from cyclopts import Group

OPTIONS = Group("Options", sort_key=1)
ARRAY = Group("Several IMUs", sort_key=2)
NOISE = Group("Noise model", sort_key=3)
VEHICLE = Group("The run", sort_key=4)
OUTAGES = Group("Outages", sort_key=5)
MOTION = Group("Motion", sort_key=6)
SIMULATED = Group("Simulated IMUs", sort_key=7)
RECEIVER = Group("Simulated receiver", sort_key=8)
SENSORS = Group("Other sensors", sort_key=9)
RESULTS = Group("Results", sort_key=10)
READING = Group("How files are read", sort_key=11)
