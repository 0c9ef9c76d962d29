"""Alignment, strapdown, error model, aiding, filter, smoother: from recordings to a trajectory."""

from schuler.navigate.navigation import (
    NavigationRun,
    generic_noise_model,
    navigate,
    prepare,
    run,
    withhold,
)

__all__ = [
    "NavigationRun",
    "generic_noise_model",
    "navigate",
    "prepare",
    "run",
    "withhold",
]
