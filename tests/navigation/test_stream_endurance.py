"""One stream at the places and rates of the endurance runs (python -m benchmarks.endurance)."""

from dataclasses import replace

import pytest

endurance = pytest.importorskip("benchmarks.endurance")


@pytest.mark.parametrize("run", endurance.PLACES, ids=lambda run: run.name)
def test_a_stream_is_honest_wherever_it_is(run):
    """Finite, positive covariance, NEES in band: poles, heights, GNSS of 0.01 to 20 Hz."""
    short = replace(run, duration=run.duration if run.gnss_rate < 1.0 else 150.0)
    assert endurance.endure(short, seed=3) == []


def test_memory_and_honesty_survive_an_outage():
    run = endurance.Run("outage", 400.0, outages=((150.0, 100.0),))
    assert endurance.endure(run, seed=4) == []
