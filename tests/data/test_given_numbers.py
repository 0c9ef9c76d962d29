"""Arrays of users: what means numbers is taken, everything else is refused by name."""

import numpy as np
import pandas
import polars
import pytest

import schuler
from schuler import ImuRecording, InputError, allan_deviation

RNG = np.random.default_rng(3)
NOISE = RNG.normal(size=400)
TAKERS = {
    "allan": lambda x: allan_deviation(x, 100.0).deviation,
    "family": lambda x: allan_deviation(x, 100.0, kind="hadamard").deviation,
    "wavelet variance": lambda x: schuler.wavelet_variance(x, 100.0).variance,
    "spectrum": lambda x: schuler.power_spectral_density(x, 100.0, onesided=True).density,
    "autocorrelation": lambda x: schuler.autocorrelation(x, 100.0).correlation,
    "autoregressive": lambda x: np.array(schuler.fit_ar(x, 2).coefficients),
    "recording": lambda x: (
        ImuRecording(
            np.arange(len(x)) / 100.0, np.zeros((len(x), 3)), np.zeros((len(x), 3)), temperature=x
        ).temperature
    ),
}


@pytest.fixture(params=TAKERS)
def taker(request):
    return TAKERS[request.param]


@pytest.mark.parametrize(
    "given",
    [
        list(NOISE), pandas.Series(NOISE), polars.Series(NOISE), np.ma.masked_array(NOISE),
        np.repeat(NOISE, 2)[::2], NOISE.astype(">f8"), pandas.Series(NOISE, dtype="Float64"),
    ],
    ids=["list", "pandas", "polars", "no mask", "strided", "big endian", "nullable"],
)  # fmt: skip
def test_arrays_of_every_kind_give_the_same_numbers(taker, given):
    np.testing.assert_allclose(taker(given), taker(NOISE), rtol=1e-10)


def test_read_only_arrays_are_taken(taker):
    fixed = NOISE.copy()
    fixed.flags.writeable = False
    np.testing.assert_array_equal(taker(fixed), taker(NOISE))


def _with(value):
    changed = NOISE.copy()
    changed[7] = value
    return changed


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (np.ma.masked_greater(NOISE, 1.0), "masked"),
        (NOISE.astype(object), "type object"),
        (NOISE + 1j, "type complex"),
        (NOISE.astype(str), "type <U"),
        (np.arange(400).astype("M8[s]"), "type datetime"),
        (NOISE > 0, "type bool"),
        (polars.Series(["x"] * 400), "signal|temperature"),
        ([[1.0, 2.0], [3.0]], "no array of numbers"),
    ],
)
def test_what_is_no_array_of_numbers_is_refused(taker, given, why):
    with pytest.raises(InputError, match=why):
        taker(given)


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 1e200, -1e200])
def test_infinite_and_absurd_numbers_are_refused(value):
    for name, taker in TAKERS.items():
        if name != "recording":
            with pytest.raises(schuler.SchulerError):
                taker(_with(value))


def test_a_recording_with_numbers_of_no_sensor_is_refused():
    time, gyro = np.arange(4) / 10.0, np.zeros((4, 3))
    accel = np.full((4, 3), 9.8)
    accel[2, 1] = 1e15
    with pytest.raises(InputError, match=r"accel_y holds numbers from 9.8 to 1e\+15"):
        ImuRecording(time, gyro, accel)
