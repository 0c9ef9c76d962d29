"""Equations (1)-(10) and (21)-(36), table 8: what is printed of the matrices, and what holds."""

from __future__ import annotations

import math

import numpy as np

from schuler.navigation.error_models.catalogue import error_model
from schuler.noise import Autoregressive, GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.types import FloatArray
from schuler_papers.experiment import Numbers, Results, Size, estimate, generator, numbers, stacked
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Row
from schuler_papers.quinchia2013.sensor import NAMES, PAPER, PRINTED, TABLE_2, fitted

DT = 0.01
CHANNEL = "accel_x"


def printed_transition(channel: str, dt: float) -> float:
    """Return the transition of a Gauss-Markov state as printed: (2), (7), (21), (22)."""
    return 1.0 - dt / PRINTED[channel].flat_time


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
    from scipy.signal import lfilter

    from schuler.curves.allan import allan_deviation

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
    from scipy.signal import lfilter

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


def noise_matrix(results: Results, size: Size) -> Outcome:
    """The printed Q, the right one, and single steps."""
    found = stacked(results, "steps")
    ours, printed = step_covariance(CHANNEL, DT), printed_noise(CHANNEL, DT)
    names = ("white noise in velocity", "Gauss-Markov state", "random walk")
    rows = []
    for k, name in enumerate(names):
        rows.append(
            Row(
                f"{name}: simulated steps over our rule",
                estimate(found[:, k] / ours[k]),
                None,
                "beyond the paper",
                band=Band(0.99, 1.01, "spec", standard_errors=2.0),
            )
        )
    for words, factor, right in (
        ("through G dt, so times dt²", DT**2, 0),
        ("as they stand", 1.0, 1),
    ):
        for k, name in enumerate(names):
            ratio = printed[k] * factor / ours[k]
            off = not math.isclose(ratio, 1.0, rel_tol=1e-6)
            wanted = 1.0 if (k == 0) == (right == 0) else (1.0 / DT**2 if right else DT**2)
            rows.append(
                Row(
                    f"{name}: printed entry {words}, over ours",
                    ratio,
                    None,
                    "wrong in the paper" if off else "reproduced",
                    band=Band(0.999 * wanted, 1.001 * wanted, "theory"),
                    reason="sample variance and state variances stand in one Q" if off else "",
                    erratum="E-004-6" if off else "",
                )
            )
    return Outcome(
        tuple(rows),
        notes=("No one G makes the printed Q right: white noise or the states are off by 10⁴.",),
    )


def euler(results: Results, size: Size) -> Outcome:
    """1 - dt/Tc with the exact variance."""
    found = stacked(results, "stationary")
    rows = []
    for k, (step, rate) in enumerate(((DT, "100 Hz"), (1.0, "1 Hz"))):
        x = step / PRINTED[CHANNEL].flat_time
        law = -math.expm1(-2.0 * x) / (2.0 * x - x**2)
        rows.append(
            Row(
                f"stationary variance over sigma², {rate}, Tc 4.56 s",
                float(found[0, k]),
                1.0,
                "wrong in the paper",
                band=Band(law - 1e-6, law + 1e-6, "theory", "(1 - exp(-2x))/(2x - x²)"),
                reason="Euler's transition (2) with the exact variance (3)",
                erratum="E-004-2",
            )
        )
    return Outcome(tuple(rows))


def one_noise(results: Results, size: Size) -> Outcome:
    """(7) drives two states with one noise."""
    tau = results[0]["7:tau"]
    one, two = stacked(results, "7:one"), stacked(results, "7:two")
    middle = (tau >= 5.0) & (tau <= 40.0)
    row = Row(
        "Allan deviation with one noise over two, cluster times of 5 to 40 s",
        estimate((one / two)[:, middle].mean(axis=1)),
        1.0,
        "wrong in the paper",
        band=Band(1.1, 1.35, "spec", "about 1.22", standard_errors=2.0),
        reason="the two increments are fully correlated",
        erratum="E-004-3",
    )
    law = sum(
        (
            p.allan_variance(tau)
            for p in error_model("18AV", PRINTED).noise_model.process(CHANNEL).parts
        ),
        np.zeros(tau.size),
    )
    inside = (two.mean(axis=0) / np.sqrt(law))[middle]
    rows = (
        row,
        Row(
            "Allan deviation with two noises over the closed forms",
            float(inside.mean()),
            None,
            "reproduced",
            band=Band(0.95, 1.05, "spec"),
        ),
    )
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
    return Outcome(rows, (panel,))


def companion(results: Results, size: Size) -> Outcome:
    """(9), (10), (31)-(36): AR in the filter."""
    rows = (
        Row(
            "companion form against the recursion, largest relative difference",
            float(stacked(results, "companion").max()),
            0.0,
            band=Band(0.0, 1e-10, "spec"),
        ),
        Row(
            "eigenvalues of the filter's blocks against the roots of the fits",
            float(stacked(results, "eigenvalues").max()),
            0.0,
            band=Band(0.0, 1e-6, "spec"),
        ),
        Row(
            "coupling of the newest state",
            float(stacked(results, "newest")[:, 0].min()),
            1.0,
            band=Band(1.0, 1.0, "spec"),
        ),
        Row(
            "coupling of the oldest state",
            float(stacked(results, "newest")[:, 1].max()),
            0.0,
            band=Band(0.0, 0.0, "spec"),
        ),
    )
    return Outcome(rows)


def table_8(results: Results, size: Size) -> Outcome:
    """States of every model."""
    rows = []
    for name, printed in (("15AV", 15), ("18AV", 18), ("18AVWD", 18), ("15AR", 15), ("27AR", 27)):
        fits = fitted(size).get({"15AR": 1, "27AR": 3}.get(name, 0))
        states = error_model(name, PRINTED, autoregressive=fits).states
        rows.append(Row(name, float(states), float(printed), band=Band(printed, printed, "spec")))
    for name in ("18AV+turn-on", "flicker4"):
        states = error_model(name, PRINTED).states
        rows.append(Row(name, float(states), None, "beyond the paper"))
    return Outcome(tuple(rows))


def rounded_roots(results: Results, size: Size) -> Outcome:
    """The printed AR(3) coefficients have a pole on or outside the unit circle."""
    rng = np.random.default_rng(10)
    rows = []
    for channel, (printed, _, _, _) in TABLE_2.items():
        polynomial = np.array([1.0, *printed])
        modulus = float(np.abs(np.roots(polynomial)).max())
        draws = polynomial + np.concatenate(
            [np.zeros((2000, 1)), rng.uniform(-5e-4, 5e-4, (2000, 3))], axis=1
        )
        largest = np.array([np.abs(np.roots(d)).max() for d in draws])
        refused = not _accepted(printed)
        share = float((largest >= 1.0).mean())
        wanted = (0.95, 1.0) if channel == "accel_x" else (0.3, 0.7)
        rows += [
            Row(
                f"{NAMES[channel]}: largest pole of the printed coefficients",
                modulus,
                None,
                "wrong in the paper",
                band=Band(0.9995, 1.05, "theory"),
                reason="refused as a process" if refused else "a pole at one",
                erratum="E-004-10",
            ),
            Row(
                f"{NAMES[channel]}: share of unstable models within the rounding",
                share,
                None,
                "wrong in the paper",
                band=Band(*wanted, "spec", "a half, 98 % for accelerometer x"),
                reason="three decimals do not hold a pole this near to one",
                erratum="E-004-10",
            ),
        ]
    moduli = stacked(results, "modulus")
    rows.append(
        Row(
            "largest pole of the fits with all digits",
            float(moduli.max()),
            None,
            "beyond the paper",
            band=Band(0.9, 1.0 - 1e-12, "theory"),
        )
    )
    return Outcome(tuple(rows))


def _accepted(coefficients: tuple[float, ...]) -> bool:
    from schuler.errors import ModelError

    try:
        Autoregressive(coefficients, 1e-12, DT)
    except ModelError:
        return False
    return True
