"""Equations (1)-(10) and (21)-(36), table 8: what is printed of the matrices, and what holds."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from schuler import (
    Autoregressive,
    GaussMarkov,
    ModelError,
    RandomWalk,
    WhiteNoise,
    allan_deviation,
    error_model,
)
from schuler_papers.experiment import (
    FloatArray,
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Curve, Panel, Proof
from schuler_papers.quinchia2013.sensor import (
    FLICKER_LEVEL,
    NAMES,
    PAPER,
    PRINTED,
    TABLE_2,
    fitted,
)

DT = 0.01
CHANNEL = "accel_x"


def printed_noise(channel: str, dt: float) -> FloatArray:
    """Return the entries of the noise covariance of a channel as printed: (26)-(30)."""
    r = PRINTED[channel]
    sigma = FLICKER_LEVEL * r.bias_instability
    return np.array(
        [
            r.white_noise**2 / dt,
            sigma**2 * -math.expm1(-2.0 * dt / r.flat_time),
            r.random_walk**2 * dt,
        ]
    )


def step_covariance(channel: str, dt: float) -> FloatArray:
    """Return what one step adds to velocity, Gauss-Markov state and random walk: ours."""
    model = error_model("18AV", PRINTED).noise_model.process(channel).state_space(dt)
    return np.array([model.white_density**2 * dt, *np.diag(model.noise_covariance)])


def run(seed: int, size: Size) -> Numbers:
    """Simulate single steps, and one noise for two processes."""
    rng = generator(seed, PAPER, "matrices")
    n = 200_000 if size == "quick" else 1_000_000
    white, markov, walk = error_model("18AV", PRINTED).noise_model.process(CHANNEL).parts
    assert isinstance(markov, GaussMarkov)
    assert isinstance(white, WhiteNoise)
    assert isinstance(walk, RandomWalk)
    phi = math.exp(-DT / markov.correlation_time)
    state = markov.simulate(n, DT, rng)
    steps = [
        float(np.var(white.simulate(n, DT, rng) * DT)),
        float(np.var(state[1:] - phi * state[:-1])),
        float(np.var(np.diff(walk.simulate(n, DT, rng)))),
    ]
    return numbers(
        steps=steps,
        stationary=_euler(markov),
        **_one_noise(rng, n),
        **_companion(rng, size),
    )


def _euler(markov: GaussMarkov) -> list[float]:
    """Stationary variance over sigma² with (2) and (3) together, at 100 Hz and at 1 Hz."""
    found = []
    for step in (DT, 1.0):
        x = step / markov.correlation_time
        mixed = Autoregressive((x - 1.0,), -math.expm1(-2.0 * x), step)
        found.append(float(mixed.autocovariance(0.0)))
    return found


def _one_noise(rng: np.random.Generator, n: int) -> dict[str, FloatArray]:
    """Accelerometer x with (7) as printed and with two noises, at 10 Hz."""
    r, dt = PRINTED[CHANNEL], 0.1
    sigma = FLICKER_LEVEL * r.bias_instability
    phi = math.exp(-dt / r.flat_time)
    drive, other = rng.standard_normal((2, n))
    white = r.white_noise / math.sqrt(dt) * rng.standard_normal(n)
    markov = lfilter([sigma * math.sqrt(1.0 - phi**2)], [1.0, -phi], drive)
    walks = [r.random_walk * math.sqrt(dt) * np.cumsum(d) for d in (drive, other)]
    taus = np.unique(np.geomspace(1.0, 300.0, 40).round(1))
    curves = [allan_deviation(white + markov + w, 1.0 / dt, taus=taus) for w in walks]
    return {"7:tau": curves[0].tau, "7:one": curves[0].deviation, "7:two": curves[1].deviation}


def _companion(rng: np.random.Generator, size: Size) -> dict[str, FloatArray]:
    """(10) against the recursion (9), and the eigenvalues of (31)-(36)."""
    fit = fitted(size)[3]["gyro_x"]
    space = fit.state_space(DT)
    drive = rng.standard_normal(2000)
    x, out = np.zeros(3), np.zeros(drive.size)
    kick = np.array([0.0, 0.0, math.sqrt(fit.driving_variance)])
    for k, w in enumerate(drive):
        x = space.transition @ x + kick * w
        out[k] = space.output @ x
    direct = lfilter([kick[2]], fit.polynomial, drive)
    block = error_model("27AR", PRINTED, autoregressive=fitted(size)[3]).sensor_model(0.0, 0.0)
    worst = max(
        float(
            np.abs(
                np.sort_complex(np.linalg.eigvals(b.transition))
                - np.sort_complex(fitted(size)[3][c].poles)
            ).max()
        )
        for b, c in zip(
            block.blocks,
            ("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z"),
            strict=True,
        )
    )
    newest = np.nan_to_num(block.direction[[b.first + 2 for b in block.blocks]], nan=1.0)
    older = np.nan_to_num(block.direction[[b.first for b in block.blocks]], nan=1.0)
    return {
        "companion": np.array(np.abs(out - direct).max() / np.abs(direct).max()),
        "eigenvalues": np.array(worst),
        "newest": np.array([np.abs(newest).max(axis=1).min(), np.abs(older).max()]),
        "modulus": np.array(
            [max(float(np.abs(f.poles).max()) for f in fitted(size)[k].values()) for k in (1, 3)]
        ),
    }


def noise_matrix(results: Results, size: Size) -> Found:
    """The printed Q, the right one, and single steps."""
    ours, printed = step_covariance(CHANNEL, DT), printed_noise(CHANNEL, DT)
    ratio = (printed / ours)[None]
    values = {
        "steps": stacked(results, "steps") / ours,
        "through": ratio * DT**2,
        "as it stands": ratio,
    }
    return Found(values)


def euler(results: Results, size: Size) -> Found:
    """1 - dt/Tc with the exact variance."""
    x = np.array([DT, 1.0]) / PRINTED[CHANNEL].flat_time
    law = -np.expm1(-2.0 * x) / (2.0 * x - x**2)
    found = stacked(results, "stationary")[:1]
    mixed = Proof(
        "(1 - exp(-2x))/(2x - x²) is not one: the variance drifts away from sigma²",
        float(law[1] - 1.0), 1e-3, 1.0,
    )  # fmt: skip
    return Found(
        {"stationary": found},
        {"stationary": np.array([law - 1e-6, law + 1e-6])},
        {"mixed": mixed},
    )


def one_noise(results: Results, size: Size) -> Found:
    """(7) drives two states with one noise."""
    tau = results[0]["7:tau"]
    one, two = stacked(results, "7:one"), stacked(results, "7:two")
    middle = (tau >= 5.0) & (tau <= 40.0)
    parts = error_model("18AV", PRINTED).noise_model.process(CHANNEL).parts
    law = sum((p.allan_variance(tau) for p in parts), np.zeros(tau.size))
    inside = float((two.mean(axis=0) / np.sqrt(law))[middle].mean())
    proof = Proof(
        "two independent noises give the closed forms of the parts, one noise does not",
        inside, 0.95, 1.05, "counter-experiment",
    )  # fmt: skip
    panel = Panel(
        "One noise or two",
        "cluster time, s",
        "Allan deviation, m/s²",
        (
            Curve("one noise (7)", tau, one.mean(axis=0), "printed"),
            Curve("two noises", tau, two.mean(axis=0), "ours"),
            Curve("closed forms", tau, np.sqrt(law), "theory", "dash"),
        ),
        "The curve of one noise lies higher in the middle.",
        log_x=True,
        log_y=True,
    )
    values: dict[str, Value] = {
        "one over two": (one / two)[:, middle].mean(axis=1),
        "two": inside,
    }
    return Found(values, proofs={"closed forms": proof}, panels=(panel,))


def companion(results: Results, size: Size) -> Found:
    """(9), (10), (31)-(36): AR in the filter."""
    newest = stacked(results, "newest")
    values = {
        "companion": float(stacked(results, "companion").max()),
        "eigenvalues": float(stacked(results, "eigenvalues").max()),
        "newest": float(newest[:, 0].min()),
        "oldest": float(newest[:, 1].max()),
    }
    return Found(values)


def table_8(results: Results, size: Size) -> Found:
    """States of every model."""

    def states(name: str) -> float:
        fits = fitted(size).get({"15AR": 1, "27AR": 3}.get(name, 0))
        return float(error_model(name, PRINTED, autoregressive=fits).states)

    printed = [states(n) for n in ("15AV", "18AV", "18AVWD", "15AR", "27AR")]
    ours = [states(n) for n in ("18AV+turn-on", "flicker4")]
    return Found({"table": np.array([[printed]]), "ours": np.array([ours])})


def rounded_roots(results: Results, size: Size) -> Found:
    """The printed AR(3) coefficients have a pole on or outside the unit circle."""
    rng = np.random.default_rng(10)
    modulus, share, refused = [], [], 0
    for printed, *_ in (TABLE_2[c] for c in TABLE_2):
        polynomial = np.array([1.0, *printed])
        modulus.append(float(np.abs(np.roots(polynomial)).max()))
        shifts = rng.uniform(-5e-4, 5e-4, (2000, 3))
        draws = polynomial + np.concatenate([np.zeros((2000, 1)), shifts], axis=1)
        largest = np.array([np.abs(np.roots(d)).max() for d in draws])
        share.append(float((largest >= 1.0).mean()))
        refused += not _accepted(printed)
    values: dict[str, Value] = {
        "modulus": np.array([modulus]),
        "share": np.array([share]),
        "own": float(stacked(results, "modulus").max()),
    }
    note = f"{refused} of {len(NAMES)} printed AR(3) models are refused as processes."
    return Found(values, notes=(note,))


def _accepted(coefficients: tuple[float, ...]) -> bool:
    try:
        Autoregressive(coefficients, 1e-12, DT)
    except ModelError:
        return False
    return True
