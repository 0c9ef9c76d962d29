"""Independent runs side by side give what they give one after the other."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from twins import NOISE, draw_twin

import schuler
from schuler.navigation import threads
from schuler.navigation.threads import in_threads
from schuler.simulation import car_urban, ideal_imu


def test_results_are_in_the_order_of_the_cases_whoever_is_first() -> None:
    def one(k: int) -> int:
        time.sleep(0.01 * (3 - k % 4))
        return k * k

    assert in_threads(one, range(9)) == [k * k for k in range(9)]
    assert in_threads(one, []) == []


def test_the_first_error_is_raised_and_what_waits_is_not_begun(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threads, "usable_cores", lambda: 2)
    begun: list[int] = []
    lock = threading.Lock()

    def one(k: int) -> int:
        with lock:
            begun.append(k)
        time.sleep(0.02)
        if k == 1:
            raise ValueError("the second")
        return k

    with pytest.raises(ValueError, match="the second"):
        in_threads(one, range(40))
    assert len(begun) < 20


def test_a_sweep_in_threads_has_the_numbers_of_one_after_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    profile = car_urban(240.0, 11, standstill=20.0)
    twin = draw_twin(profile, ideal_imu(profile, 50.0), 4)
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(threads, "usable_cores", lambda cores=cores: cores)
        found.append(
            schuler.evaluate_outages(
                twin.imu, twin.gnss, NOISE, sweep=(20.0, 10.0), time_offset=0.0, lag=3.0
            )
        )
    one, other = (f.to_dict() for f in found)
    assert one == other
    assert len(found[0].runs) > 3
    for a, b in zip(found[0].solutions, found[1].solutions, strict=True):
        np.testing.assert_array_equal(a[1].trajectory.position, b[1].trajectory.position)
