"""Flicker, lines, outliers and temperature: found, said, and kept out of the noise model."""

from __future__ import annotations

import math
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks.identification import CASES, PER_HOUR, PER_ROOT_HOUR, flicker, markov, white

import schuler
from schuler.data.imu import ImuRecording
from schuler.errors import InputError
from schuler.estimation.disturbances.covariates import _width, without_covariates
from schuler.estimation.disturbances.lines import without_lines
from schuler.estimation.disturbances.steps import step_of
from schuler.noise.effects import Effect, compensated
from schuler.noise.gauss_markov import BiasInstability
from schuler.screening.screen import longest_rest, repair_until_clean, screen
from schuler.types import FloatArray


def kinds(found: schuler.Identification) -> list[str]:
    return [p.kind for p in found.process.parts]


def test_flicker_of_samples_is_flicker_in_any_clusters() -> None:
    m = np.array([1, 2, 4, 16, 256, 4096])
    got = BiasInstability.of_samples(1.0, 0.1, 1e5).sampled_allan_variance(m, 0.1)
    # exact at one sample: 2/pi B²; at many: 2 ln 2/pi B²
    assert got[0] == pytest.approx(2.0 / math.pi, rel=0.012)
    assert got[-1] == pytest.approx(2.0 * math.log(2.0) / math.pi, rel=0.005)


def test_closed_forms_of_samples_are_those_of_their_covariance() -> None:
    dt = 0.1
    process = schuler.GaussMarkov(1.3, 0.25) + schuler.RandomWalk(0.4)
    for m in (1, 2, 5, 30):
        taps = np.concatenate([np.full(m, -1.0 / m), np.full(m, 1.0 / m)])
        k = np.arange(2 * m)
        gm = 1.3**2 * np.exp(-np.abs(k[:, None] - k) * dt / 0.25)
        walk = 0.4**2 * dt * np.minimum(k[:, None], k)
        expected = 0.5 * taps @ (gm + walk) @ taps
        got = process.sampled_allan_variance(np.array([m]), dt)[0]
        assert got == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("method", ["allan", "gmwm", "psd"])
def test_a_flicker_sensor_is_found_as_one(method: str) -> None:
    case = CASES["phone"]
    x = case.signal(np.random.default_rng(77))
    found = schuler.identify(x, case.rate, method=method)
    assert [p.kind for p in found.process.components] == ["white_noise", "bias_instability"]
    b, error = (d["bias_instability.level"] for d in (found.parameters, found.standard_errors))
    assert abs(b / case.truth["B"] - 1.0) < 0.06
    assert abs(b - case.truth["B"]) < 4.0 * error
    entry = found.ieee952["B"]
    assert entry.value == b
    assert found.ieee952["K"].value is None


def test_where_there_is_no_flicker_it_is_bounded_and_readings_keep_their_name() -> None:
    case = CASES["wk"]
    found = schuler.identify(case.signal(np.random.default_rng(5)), case.rate)
    assert kinds(found) == ["white_noise", "random_walk"]
    entry = found.to_dict()["ieee952"]["B"]
    assert entry["value"] is None
    assert 0.0 < entry["upper_limit"] < 0.7 * entry["classical_reading"]["minimum"]
    assert entry["classical_reading"]["flicker_share"] == 0.0


def test_a_walk_that_was_missed_is_not_excluded() -> None:
    # a longer Gauss-Markov noise stands in for the walk: slopes alone excluded less than half of it
    case = CASES["wgk"]
    key = zlib.crc32(repr(case).encode())
    found = schuler.identify(case.signal(np.random.default_rng([9410006, key])), case.rate)
    assert kinds(found) == ["white_noise", "gauss_markov"]
    assert 1.0 < found.limits["random_walk.density"] / case.truth["K"] < 3.0
    assert found.limits["bias_instability.level"] > 0.0


def test_fast_gauss_markov_noise_leaves_the_white_noise_alone() -> None:
    case = CASES["fast5"]
    x = case.signal(np.random.default_rng(6))
    for method in ("allan", "gmwm"):
        found = schuler.identify(x, case.rate, method=method)
        n, error = (d["white_noise.density"] for d in (found.parameters, found.standard_errors))
        assert abs(n - case.truth["N"]) < 4.0 * error


def test_structures_are_spelled_and_misspellings_named() -> None:
    x = CASES["short"].signal(np.random.default_rng(7))
    assert kinds(schuler.identify(x, 100.0, "W+G")) == ["white_noise", "gauss_markov"]
    assert kinds(schuler.identify(x, 100.0, "w + b + k"))[1:] == ["bias_instability", "random_walk"]
    for wrong in ("W+X", "W+W", "", "W+G+G+G+G"):
        with pytest.raises(InputError, match="letters such as W"):
            schuler.identify(x, 100.0, wrong)


def vibrating(seed: int) -> tuple[FloatArray, FloatArray, float, float]:
    rng, rate = np.random.default_rng(seed), 52.0
    n, dt, density = round(1200 * rate), 1.0 / rate, 1e-3
    amplitude = 1.4 * density / math.sqrt(dt)
    noise = white(n, dt, density, rng) + markov(n, dt, 2e-3, 20.0, rng)
    line = amplitude * np.sin(2.0 * np.pi * 50.0 * np.arange(n) * dt + rng.uniform(0.0, 6.0))
    return noise, noise + line, amplitude, density


def test_a_line_is_named_with_its_aliases_and_leaves_the_white_noise() -> None:
    _, x, amplitude, density = vibrating(8)
    found = schuler.identify(x, 52.0)
    (line,) = found.lines
    assert abs(line.frequency - 2.0) < 4.0 * line.frequency_error < 1e-4
    assert abs(line.amplitude - amplitude) < 4.0 * line.amplitude_error
    assert line.aliases == pytest.approx((50.0, 54.0), abs=1e-3)
    assert found.parameters["white_noise.density"] == pytest.approx(density, rel=0.01)
    assert "sinusoid" in kinds(found)
    assert any("line at 2" in flag for flag in found.flags)


@pytest.mark.parametrize("method", ["slope", "psd", "gmwm", "ml"])
def test_every_method_sees_the_signal_without_its_line(method: str) -> None:
    _, x, amplitude, density = vibrating(18)
    found = schuler.identify(x, 52.0, method=method)
    assert len(found.lines) == 1
    assert found.parameters["sinusoid.amplitude"] == pytest.approx(amplitude, rel=0.01)
    # straight lines on a curve are read, not fitted
    close = 0.05 if method == "slope" else 0.01
    assert found.parameters["white_noise.density"] == pytest.approx(density, rel=close)
    assert "quantization" not in {p.kind for p in found.process.components}
    assert found.to_dict()["lines"][0]["frequency_hz"] == pytest.approx(2.0, abs=1e-4)


def test_a_sinusoid_of_the_models_own_is_left_to_the_fit() -> None:
    _, x, amplitude, _ = vibrating(19)
    model = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(2e-3, 20.0) + schuler.Sinusoid(0.01, 2.0)
    found = schuler.identify(x, 52.0, model)
    assert found.lines == ()
    assert found.parameters["sinusoid.amplitude"] == pytest.approx(amplitude, rel=0.02)


def test_methods_share_one_signal_without_its_line() -> None:
    _, x, _, density = vibrating(20)
    seen = schuler.compare_methods(x, 52.0, ("allan", "gmwm", "psd"))
    assert len(seen.results) == 3
    for result in seen.results.values():
        assert result.parameters["white_noise.density"] == pytest.approx(density, rel=0.01)
        assert [p.kind for p in result.process.components].count("sinusoid") == 1


def test_noise_without_lines_is_returned_as_it_was() -> None:
    noise, *_ = vibrating(9)
    assert without_lines(noise, 52.0).signal is noise


def test_a_wandering_line_is_filled_and_no_quantisation_believed() -> None:
    noise, _, amplitude, density = vibrating(10)
    n, dt, rng = noise.size, 1.0 / 52.0, np.random.default_rng(11)
    frequency = 17.3 + markov(n, dt, 0.05, 60.0, rng)
    found = schuler.identify(
        noise + amplitude * np.sin(2.0 * np.pi * np.cumsum(frequency) * dt), 52.0
    )
    assert not found.lines[0].steady
    assert found.lines[0].frequency == pytest.approx(17.3, abs=0.1)
    assert found.lines[0].amplitude == pytest.approx(amplitude, rel=0.1)
    assert found.parameters["white_noise.density"] == pytest.approx(density, rel=0.02)
    assert "quantization" not in kinds(found)


def recording(x: FloatArray, rate: float, **more: FloatArray) -> ImuRecording:
    rng = np.random.default_rng(12)
    n, sd = x.size, float(np.std(np.diff(x)))
    gyro = np.column_stack([x, rng.standard_normal((n, 2)) * sd])
    accel = rng.standard_normal((n, 3)) * 1e-3 + np.array([0.0, 0.0, 9.81])
    return ImuRecording(time=np.arange(n) / rate, gyro=gyro, accel=accel, name="made", **more)


def test_outliers_take_the_robust_route_and_knocks_among_them_are_cut() -> None:
    case = CASES["short"]
    rng = np.random.default_rng(13)
    x = case.signal(rng)
    sd = case.truth["N"] * math.sqrt(case.rate)
    x = x + (rng.random(x.size) < 0.01) * rng.standard_normal(x.size) * 15.0 * sd
    for row in (6000, 15_000, 24_000):
        x[row : row + 10] += 500.0 * sd * rng.standard_normal(10)
    imu = recording(x, case.rate)
    seen = screen(imu)
    assert [len(f.intervals) for f in seen.of_kind("knock")] == [3]
    clean = repair_until_clean(imu, seen)
    assert 60 < imu.size - clean.size < 600
    found = schuler.identify(clean.channel("gyro_x"), case.rate)
    assert "gmwm-robust" in found.flags[0]
    assert found.parameters["white_noise.density"] == pytest.approx(case.truth["N"], rel=0.02)


def warmed(seed: int, per_kelvin: float) -> tuple[FloatArray, FloatArray, float]:
    rng, rate = np.random.default_rng(seed), 2.0
    n = round(6 * 3600 * rate)
    t = np.arange(n) / rate
    celsius = 25.0 + 6.0 * (1.0 - np.exp(-t / 3600.0)) + markov(n, 1.0 / rate, 0.5, 1200.0, rng)
    x = white(n, 1.0 / rate, 0.2 * PER_ROOT_HOUR, rng) + flicker(n, 6.0 * PER_HOUR, rng)
    column = celsius + 0.03 * rng.standard_normal(n)
    return x + per_kelvin * PER_HOUR * celsius, column, rate


def test_temperature_is_taken_off_saved_and_applied(tmp_path: Path) -> None:
    x, celsius, rate = warmed(14, 20.0)
    found = schuler.identify(x, rate, columns={"temperature": celsius})
    effect = found.effects[0]
    assert (effect.column, effect.term) == ("temperature", "linear")
    assert abs(effect.coefficient / PER_HOUR - 20.0) < 4.0 * effect.standard_error / PER_HOUR < 8.0
    assert kinds(found) == ["white_noise", "bias_instability"]
    model = schuler.NoiseModel({"gyro_x": found.process}, effects={"gyro_x": found.effects})
    model.save(tmp_path / "n.yaml")
    (read,) = schuler.NoiseModel.load(tmp_path / "n.yaml").effects["gyro_x"][:1]
    assert read.coefficient == pytest.approx(effect.coefficient, rel=1e-6)
    imu = recording(x, rate, temperature=celsius)
    done = compensated(imu, model.effects)
    assert np.std(done.gyro[-5000:, 0]) < np.std(imu.gyro[:, 0])
    assert "temperature" in done.history[-1]
    assert compensated(replace(imu, temperature=None), model.effects).gyro is not None


@pytest.mark.parametrize("method", ["gmwm", "psd"])
def test_every_method_takes_the_temperature_off(method: str) -> None:
    x, celsius, rate = warmed(21, 20.0)
    found = schuler.identify(x, rate, method=method, columns={"temperature": celsius})
    assert found.effects[0].column == "temperature"
    assert [p.kind for p in found.process.components] == ["white_noise", "bias_instability"]
    assert any("follows the temperature" in flag for flag in found.flags)
    with pytest.raises(InputError, match="columns for method 'arma'"):
        schuler.identify(x, rate, method="arma", columns={"temperature": celsius})


def test_a_temperature_that_does_not_matter_is_left_alone() -> None:
    x, celsius, rate = warmed(15, 0.0)
    assert without_covariates(x, rate, {"temperature": celsius}).effects == ()


@pytest.mark.parametrize("seed", [31, 32])
def test_steps_of_a_column_do_not_shrink_the_slope_on_it(seed: int) -> None:
    x, celsius, rate = warmed(seed, 20.0)
    fine = without_covariates(x, rate, {"temperature": celsius}).effects[0]
    # levels are where the sensor has them, not at whole numbers
    found = without_covariates(x, rate, {"temperature": np.round(celsius) + 273.65})
    linear = found.effects[0]
    assert abs(linear.coefficient - fine.coefficient) < 1.5 * linear.standard_error
    assert linear.standard_error < 4.0 * PER_HOUR
    assert "steps of 1" in found.flags[0]


def test_a_column_in_steps_that_does_not_matter_is_left_alone() -> None:
    x, celsius, rate = warmed(34, 0.0)
    shown = np.round(celsius * 2.0) / 2.0
    assert without_covariates(x, rate, {"temperature": shown}).effects == ()


@pytest.mark.parametrize(("held", "step"), [(1, 0.0), (50, 0.0), (1, 0.25)])
def test_steps_are_told_from_values_that_are_held(held: int, step: float) -> None:
    column = 20.0 + np.repeat(np.cumsum(np.random.default_rng(35).normal(0.0, 0.01, 4000)), held)
    assert step_of(np.round(column / step) * step if step else column) == pytest.approx(step)


def test_columns_that_say_nothing_are_named() -> None:
    x, celsius, rate = warmed(16, 0.0)
    constant = without_covariates(x, rate, {"temperature": np.full(x.size, 20.0)})
    assert "constant" in constant.flags[0]
    holes = celsius.copy()
    holes[100:200] = np.nan
    assert "100 missing" in without_covariates(x, rate, {"temperature": holes}).flags[0]
    with pytest.raises(InputError, match="shape"):
        without_covariates(x, rate, {"temperature": celsius[:-1]})


def test_effects_of_every_term() -> None:
    values = np.array([20.0, 22.0, 24.0])
    assert Effect("temperature", "linear", 2.0, 0.1, 20.0).of(values, 10.0).tolist() == [0, 4, 8]
    assert Effect("temperature", "square", 2.0, 0.1, 20.0).of(values, 10.0).tolist() == [0, 8, 32]
    assert Effect("temperature", "rate", 2.0, 0.1, 20.0).of(values, 10.0).tolist() == [40] * 3


def test_the_longest_rest_of_a_moved_log_is_taken() -> None:
    x = CASES["short"].signal(np.random.default_rng(17))
    imu = recording(x, 100.0)
    moved = np.array(imu.gyro)
    moved[9000:12_000] += np.sin(np.arange(3000) * 0.05)[:, None]
    rest = longest_rest(replace(imu, gyro=moved), screen(replace(imu, gyro=moved)))
    assert 160.0 < rest.duration < 190.0


def test_where_every_sample_is_an_outlier_the_answer_says_so() -> None:
    x = np.random.default_rng(22).standard_cauchy(30_000)
    found = schuler.identify(x, 100.0)
    assert "outliers" in found.flags[0] or "outlier" in found.flags[0]
    assert all(math.isfinite(v) for v in found.parameters.values())


def test_what_was_taken_off_is_said_in_units_of_the_sensor() -> None:
    x, celsius, rate = warmed(23, 20.0)
    t = np.arange(x.size) / rate
    x = x + 2000.0 * PER_HOUR * np.sin(2.0 * math.pi * 0.3 * t)
    found = schuler.characterize_imu(recording(x, rate, temperature=celsius))
    said = [line for line in found.findings if line.startswith("gyro_x: ")]
    assert any("deg/h per K, which was taken off" in line for line in said)
    assert any("0.3 Hz" in line and "deg/s was taken out" in line for line in said)


@pytest.mark.parametrize(
    ("read_noise", "step", "least", "most"),
    [(0.0, 0.0, 1, 1), (0.03, 0.0, 8, 30), (0.0, 0.2, 5, 99)],
)
def test_a_column_is_smoothed_as_far_as_its_own_noise_asks(
    read_noise: float, step: float, least: int, most: int
) -> None:
    """Smoothed further, what the signal follows quickly stays in it and looks like noise."""
    rng = np.random.default_rng(11)
    column = np.cumsum(0.0075 * rng.standard_normal(40_000))
    column += read_noise * rng.standard_normal(column.size)
    if step:
        column = np.round(column / step) * step
    assert least <= _width(column, 160) <= most
