"""Alignment, strapdown, error model, aiding, filter, smoother: from recordings to a trajectory."""

from schuler.navigate.generic import generic_noise_model
from schuler.navigate.mechanizations import ArrayNavigation, navigate_array
from schuler.navigate.navigation import navigate, withhold
from schuler.navigate.preparation import prepare
from schuler.navigate.running import NavigationRun, run

__all__ = [
    "ArrayNavigation",
    "NavigationRun",
    "generic_noise_model",
    "navigate",
    "navigate_array",
    "prepare",
    "run",
    "withhold",
]
