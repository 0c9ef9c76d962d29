"""FOS models as states of the filter, which Tamazin 2013 leaves to others; Burg, Allan beside."""

from __future__ import annotations

import math
from dataclasses import replace

from schuler import (
    Autoregressive,
    SensorDenoising,
    autoregressive_fits,
    draw_outage_twin,
    error_model,
    fast_orthogonal_search,
    run_outages,
    simulate_static,
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
from schuler_papers.judging import Found
from schuler_papers.quinchia2013.outages import twins
from schuler_papers.quinchia2013.sensor import CHANNELS, PAPER, PRINTED, RATE, TRUE, twin

MINUTES = 30.0
NAMES = ("FOS", "27AR", "18AV", "flicker4")


def run(seed: int, size: Size) -> Numbers:
    """Drive the first drive with third-order models that FOS and Burg found in one record."""
    rng = generator(seed, PAPER, "wishes")
    record = simulate_static(twin(), 60.0 * MINUTES, RATE, rng)
    quiet = SensorDenoising.table_7().apply(record)
    searched = {c: searched_model(quiet.channel(c)) for c in CHANNELS}
    burg = autoregressive_fits(record, (3,))[3]
    models = (
        replace(error_model("27AR", PRINTED, autoregressive=searched), name="FOS"),
        error_model("27AR", PRINTED, autoregressive=burg),
        error_model("18AV", PRINTED),
        error_model("flicker4", TRUE),
    )
    drive = twins()[0]
    done = run_outages(drive, models, draw_outage_twin(drive, rng))
    return numbers(ends=[[w.end_m for w in done[n][0].windows] for n in NAMES])


def searched_model(signal: FloatArray) -> Autoregressive:
    """Return the AR(3) that a search of degree one finds."""
    fit = fast_orthogonal_search(signal, 3, 1, 3, stopping=None)
    weights = dict(zip(fit.terms, fit.coefficients, strict=True))
    lags = tuple(-float(weights[(lag,)]) for lag in (1, 2, 3))
    return Autoregressive(lags, fit.mean_square_error, 1.0 / RATE)


def judge(results: Results, size: Size) -> Found:
    """Root mean square of the errors at the ends, over that of Burg and of the Allan model."""
    ends = stacked(results, "ends")
    squares = (ends**2).mean(axis=2)

    def over(a: str, b: str) -> float:
        one, two = (squares[:, NAMES.index(n)].sum() for n in (a, b))
        return math.sqrt(one / two)

    return Found({f"over {b}": over("FOS", b) for b in NAMES[1:]})
