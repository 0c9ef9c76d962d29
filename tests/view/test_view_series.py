"""What is sent of a long recording shows every extreme, and is small."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.view.series import POINTS, Series

N = 1_500_000


def numbers(typed: dict[str, str]) -> Any:
    return np.frombuffer(base64.b64decode(typed["bdata"]), dtype=f"<{typed['dtype']}")


@pytest.fixture(scope="module")
def recording() -> ImuRecording:
    time = 2e5 + np.arange(N) / 100.0
    time[1_000_000:] += 500.0
    gyro, accel = np.zeros((2, N, 3))
    accel[:, 0] = np.sin(np.arange(N) / 1e4)
    accel[[777_777, N - 1], 2] = 9.0, 8.0
    accel[123, 2] = -7.0
    return ImuRecording(time, gyro, accel)


@pytest.mark.parametrize(
    "span", [(2e5, 2e5 + 15_500.0), (2e5, 2e5 + 9_000.0), (2e5 + 7_777.5, 2e5 + 7_778.5)]
)
def test_extremes_and_gaps_are_seen_at_every_zoom(
    recording: ImuRecording, span: tuple[float, float]
) -> None:
    found = Series(recording).window(*span)
    inside = (recording.time >= span[0]) & (recording.time <= span[1])
    time = numbers(found["x"])
    assert 2 < time.size <= POINTS + 4
    assert (np.diff(time) > 0).all()
    lines = {line["name"]: line["y"] for line in found["groups"][1]["lines"]}
    for k, axis in enumerate("xyz"):
        drawn, raw = numbers(lines[f"accel_{axis}"]), recording.accel[inside, k]
        assert np.nanmax(drawn) == pytest.approx(raw.max(), abs=1e-3)
        assert np.nanmin(drawn) == pytest.approx(raw.min(), abs=1e-3)
        # where it is seen is where it is, to the width of a stretch
        if axis == "z":
            peak = time[np.nanargmax(drawn)]
            assert abs(peak - recording.time[inside][raw.argmax()]) <= 2.5 * np.ptp(span) / POINTS
    assert np.isnan(numbers(lines["accel_x"])).any() == (span[1] - span[0] > 10_000.0)


def test_nothing_there_is_said(recording: ImuRecording) -> None:
    with pytest.raises(InputError, match="nothing was recorded there"):
        Series(recording).window(9e9, 9.1e9)
