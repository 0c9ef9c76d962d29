"""Many draws of one drive: errors as large as claimed, the same draw for every model."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from schuler import FilterExperiment, NoiseModel, RandomWalk, WhiteNoise, monte_carlo
from schuler.errors import InputError
from schuler.simulation import car_urban


def model(size: float) -> NoiseModel:
    return NoiseModel.isotropic(
        WhiteNoise(size * 2e-4) + RandomWalk(2e-6), WhiteNoise(size * 2e-3) + RandomWalk(1e-4)
    )


def test_claims_hold_and_a_wrong_model_is_found_out() -> None:
    profile = car_urban(55.0, np.random.default_rng(5), standstill=5.0)
    told = {"right": model(1.0), "sure": model(0.1), "loose": model(100.0)}
    experiment = FilterExperiment(profile, model(1.0), told, lever_arm=np.array([0.5, 0.0, -1.0]))
    result = monte_carlo(experiment, 40, seed=20)
    mean, low, high = result.squares_within("right: nees", 9)
    assert low < mean < high
    assert result.mean("right: nis") == pytest.approx(1.0, abs=0.05)
    assert result.squares_within("sure: nees", 9)[0] > high
    # on the same draws the right model is better
    assert result.compare("right: rms", "loose: rms").standard_errors_apart < -2.0
    with ThreadPoolExecutor(2) as threads:
        again = monte_carlo(experiment, 6, seed=20, executor=threads)
    for name, values in again.values.items():
        assert np.array_equal(values, result.values[name][:6])


def test_what_cannot_be() -> None:
    profile = car_urban(55.0, np.random.default_rng(5), standstill=5.0)
    with pytest.raises(InputError, match="position_sd"):
        FilterExperiment(profile, model(1.0), position_sd=0.0)
    with pytest.raises(InputError, match="nine numbers"):
        FilterExperiment(profile, model(1.0), start_sd=np.ones(3))
