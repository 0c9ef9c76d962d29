"""A process that a user defines outside the package goes everywhere a process of ours goes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import ArrayLike

import schuler
from schuler.errors import InputError, ModelError
from schuler.noise import Parameter, Process, StateSpace, WhiteNoise, registry
from schuler.types import FloatArray

DT = 0.05
CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


@dataclass(frozen=True, slots=True)
class SmoothNoise(Process):
    """Second-order Gauss-Markov noise, critically damped: R = sigma² (1 + |t|/T) exp(-|t|/T)."""

    sigma: float
    time_constant: float
    kind: ClassVar[str] = "smooth_noise"
    about: ClassVar[dict[str, Parameter]] = {
        "sigma": Parameter("size", "smooth noise sigma", "{} bias"),
        "time_constant": Parameter("time", "smooth noise T", "correlation time"),
    }

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        x = np.abs(np.asarray(lag, dtype=np.float64)) / self.time_constant
        return np.asarray(self.sigma**2 * (1.0 + x) * np.exp(-x))

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        turn = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64) * self.time_constant
        level = 4.0 * self.sigma**2 * self.time_constant * (2.0 if onesided else 1.0)
        return np.asarray(level / (1.0 + turn**2) ** 2)

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        one = np.asarray(cycles, dtype=np.float64)
        folded = [self.psd((one + k) / dt, onesided=False) for k in range(-20, 21)]
        return np.asarray(sum(folded) / dt)

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        x = np.asarray(tau, dtype=np.float64) / self.time_constant
        # twice the integrated autocovariance, from the double integral of (1 + x) exp(-x)

        def spread(z: FloatArray) -> FloatArray:
            return 4.0 * z - 6.0 + (6.0 + 2.0 * z) * np.exp(-z)

        small = x < 0.02
        full = (4.0 * spread(x) - spread(2.0 * x)) / (2.0 * x**2)
        return np.asarray(self.sigma**2 * np.where(small, 0.5 * x**2, full))

    def state_space(self, dt: float) -> StateSpace:
        # two first-order lags in a row: the second feels the first
        rate = 1.0 / self.time_constant
        e = math.exp(-rate * dt)
        transition = e * np.array([[1.0 + rate * dt, dt], [-(rate**2) * dt, 1.0 - rate * dt]])
        start = self.sigma**2 * np.diag([1.0, rate**2])
        return StateSpace(
            dt=dt,
            transition=transition,
            noise_covariance=start - transition @ start @ transition.T,
            output=np.array([1.0, 0.0]),
            initial_covariance=start,
            white_density=0.0,
            drift=np.array([[0.0, 1.0], [-(rate**2), -2.0 * rate]]),
            diffusion=np.diag([0.0, 4.0 * rate**3 * self.sigma**2]),
            names=("smooth noise", "smooth noise rate"),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        space = self.state_space(dt)
        root = np.linalg.cholesky(space.noise_covariance + 1e-18 * np.eye(2))
        state = np.sqrt(np.diag(space.initial_covariance)) * rng.standard_normal(2)
        drive = rng.standard_normal((n, 2)) @ root.T
        out = np.empty(n)
        for k in range(n):
            out[k] = state[0]
            state = space.transition @ state + drive[k]
        return out


TRUTH = WhiteNoise(1e-3) + SmoothNoise(2e-3, 3.0)


@pytest.fixture(scope="module")
def signal() -> FloatArray:
    return TRUTH.simulate(72_000, DT, np.random.default_rng(3))


@pytest.mark.parametrize("method", ["allan", "gmwm", "psd"])
def test_it_is_fitted(signal: FloatArray, method: str) -> None:
    start = WhiteNoise(1.0) + SmoothNoise(1.0, 1.0)
    found = schuler.identify(signal, 1.0 / DT, start, method)
    truth = TRUTH.parameters
    for name in ("white_noise.density", "smooth_noise.sigma", "smooth_noise.time_constant"):
        error = found.standard_errors[name]
        assert abs(found.parameters[name] - truth[name]) < 4.0 * error, (name, found.parameters)
        assert error < 0.25 * truth[name]


def test_its_covariances_are_imitated() -> None:
    seen = SmoothNoise(2e-3, 3.0).elements(DT)
    m = np.array([60.0, 200.0, 2000.0])
    imitated = sum(schuler.GaussMarkov(math.sqrt(v), t).allan_variance(m * DT)
                   for v, t in seen.gauss_markovs)  # fmt: skip
    np.testing.assert_allclose(imitated, SmoothNoise(2e-3, 3.0).allan_variance(m * DT), rtol=0.5)


def test_it_is_saved_loaded_filtered_exported_and_shown(tmp_path: Path) -> None:
    from schuler.navigation.error_models.sensor_error_model import sensor_error_model
    from schuler.report.sections.noise.parameters import parameter_rows

    model = schuler.NoiseModel(
        dict.fromkeys(CHANNELS, TRUTH),
        {"gyro_x": {"smooth_noise.time_constant": 0.2}},
        rate=20.0,
        limits={"gyro_x": {"random_walk.density": 1e-6}},
    )
    model.save(tmp_path / "noise.yaml")
    again = schuler.NoiseModel.load(tmp_path / "noise.yaml")
    assert again.process("accel_z").parameters == pytest.approx(TRUTH.parameters)
    assert again.standard_errors["gyro_x"]["smooth_noise.time_constant"] == pytest.approx(0.2)
    assert "time_constant: 3 +- 0.2 s" in model.to_yaml()
    states = sensor_error_model(again, turn_on_accel=0.1, turn_on_gyro=0.01, interval=0.01)
    assert "gyro_x smooth noise" in states.names
    assert "gyroscope_noise_density" in schuler.kalibr_yaml(again, rate=20.0)
    words = [row[1] for row in parameter_rows(again, "datasheet")[1]]
    assert "smooth noise sigma" in words
    assert "smooth noise T" in words


def test_of_several_sensors_it_is_summed_in_its_class() -> None:
    (one,) = SmoothNoise.combined([(SmoothNoise(3.0, 2.0), 0.5), (SmoothNoise(4.0, 2.0), 0.5)])
    assert one == SmoothNoise(2.5, 2.0)


def test_an_installed_package_offers_its_kind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(registry._CLASSES, "smooth_noise")
    point = EntryPoint("smooth_noise", f"{__name__}:SmoothNoise", registry.GROUP)
    asked: list[dict[str, str]] = []

    def offered(**wanted: str) -> EntryPoints:
        asked.append(wanted)
        registry.enrol(SmoothNoise)
        return EntryPoints([point]).select(**wanted)

    monkeypatch.setattr("importlib.metadata.entry_points", offered)
    monkeypatch.setattr(EntryPoint, "load", lambda self: SmoothNoise)
    assert registry.process_class("smooth_noise") is SmoothNoise
    assert asked == [{"group": "schuler.processes", "name": "smooth_noise"}]


def test_a_kind_that_nobody_defined_is_refused_with_the_cure(tmp_path: Path) -> None:
    file = tmp_path / "noise.yaml"
    file.write_text("channels:\n  gyro_x:\n    - unheard_of:\n        a: 1\n")
    with pytest.raises(InputError, match=r"unheard_of.*import the module.*schuler.processes"):
        schuler.NoiseModel.load(file)


def test_time_series_processes_keep_their_coefficients_in_a_sum() -> None:
    from schuler.noise import ARMA, Autoregressive

    rng = np.random.default_rng(8)
    for part in (Autoregressive((-0.5,), 1e-4, 0.01), ARMA((0.5,), (0.2,), 1e-4, 0.01)):
        truth = WhiteNoise(1e-3) + part
        found = schuler.identify(truth.simulate(50_000, 0.01, rng), 100.0, model=truth)
        key = f"{part.kind}.driving_variance"
        assert found.parameters[key] == pytest.approx(1e-4, abs=4.0 * found.standard_errors[key])


def test_what_breaks_the_protocol_is_named() -> None:
    with pytest.raises(ModelError, match="kind is 'white_noise', which"):

        class Taken(SmoothNoise):
            kind = "white_noise"

    @dataclass(frozen=True, slots=True)
    class Scalar(SmoothNoise):
        kind: ClassVar[str] = "scalar_answer"

        def allan_variance(self, tau: ArrayLike) -> FloatArray:
            return np.asarray(1.0)

    with pytest.raises(ModelError, match=r"Scalar.allan_variance.*three finite numbers"):
        _ = WhiteNoise(1.0) + Scalar(1.0, 1.0)

    @dataclass(frozen=True, slots=True)
    class Misnamed(SmoothNoise):
        kind: ClassVar[str] = "misnamed"
        about: ClassVar[dict[str, Parameter]] = {"sigam": Parameter("size")}

    with pytest.raises(ModelError, match=r"Misnamed.about speaks of 'sigam'.*sigma"):
        _ = WhiteNoise(1.0) + Misnamed(1.0, 1.0)

    @dataclass(frozen=True, slots=True)
    class Nameless(SmoothNoise):
        pass

    with pytest.raises(ModelError, match="Nameless has no kind"):
        _ = WhiteNoise(1.0) + Nameless(1.0, 1.0)
