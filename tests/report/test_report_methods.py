"""Pages about methods: their numbers are the results' numbers, their lines the processes'."""

from __future__ import annotations

import base64
import functools
import json
import math
import re
from typing import Any

import numpy as np
import pytest

from schuler.data.imu import ImuRecording
from schuler.denoising import allan_effect, denoise
from schuler.estimation.comparison.methods import (
    ImuMethodComparison,
    compare_methods,
    compare_methods_imu,
)
from schuler.estimation.comparison.replicates import compare_replicates
from schuler.noise import RandomWalk, WhiteNoise
from schuler.report import FigureGrid, Table, render_report
from schuler.report.page import plotly_script
from schuler.report.sections import sections_of
from schuler.report.sections.noise.denoising import denoising_section
from schuler.report.sections.noise.method_words import quantity
from schuler.report.sections.noise.residuals import probability

RATE = 20.0
N = {"gyro": 1e-4, "accel": 2e-3}
K = {"gyro": 3e-6, "accel": 4e-5}
METHODS = ("allan", "slope", "psd", "gmwm", "ml", "ar", "fos", "garch")


def recording(seed: int) -> ImuRecording:
    rng = np.random.default_rng(seed)
    n = 20_000
    columns = {
        s: [(WhiteNoise(N[s]) + RandomWalk(K[s])).simulate(n, 1.0 / RATE, rng) for _ in range(3)]
        for s in N
    }
    nothing = np.full(n, np.nan)
    gyro = np.column_stack([columns["gyro"][0], nothing, nothing])
    accel = np.column_stack([nothing, nothing, columns["accel"][2]])
    return ImuRecording(np.arange(1, n + 1) / RATE, gyro, accel, name=f"run {seed}")


@functools.cache
def compared() -> ImuMethodComparison:
    return compare_methods_imu(recording(1), METHODS)


@functools.cache
def page() -> str:
    return render_report(compared(), title="Methods")


def figures() -> list[dict[str, Any]]:
    found = re.findall(r'<script type="application/json" id="figure-\d+">(.*?)</script>', page())
    return [json.loads(text) for text in found]


def numbers(encoded: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(encoded["bdata"]), dtype="<f4").astype(float)


def tables() -> dict[str, Table]:
    return {
        block.caption: block
        for section in sections_of(compared())
        for block in section.blocks
        if isinstance(block, Table)
    }


def figure_with(title: str) -> list[dict[str, Any]]:
    return [f for f in figures() if title in json.dumps(f["layout"], ensure_ascii=False)]


def test_parameters_are_those_of_the_results_in_datasheet_units() -> None:
    table = next(t for c, t in tables().items() if c.startswith("Parameters by method"))
    rows = [r for r in table.rows if r[1] == "white noise N"]
    assert [r[0] for r in rows] == ["Gyro x", "Accel z"]
    assert rows[0][2] == "deg/√h"
    for row, channel in zip(rows, ("gyro_x", "accel_z"), strict=True):
        # rad/s/sqrt(Hz) to deg/sqrt(h), m/s²/sqrt(Hz) to m/s/sqrt(h)
        factor = math.degrees(60.0) if channel == "gyro_x" else 60.0
        for method in ("allan", "psd", "gmwm", "ml"):
            shown = row[table.columns.index(method)]
            value = compared().channels[channel].results[method].parameters["white_noise.density"]
            assert float(re.sub(r"\(.*", "", shown)) == pytest.approx(value * factor, rel=2e-3)
            assert value == pytest.approx(N[channel.split("_")[0]], rel=0.05)
    assert "ar" not in table.columns


def test_the_lines_are_the_theory_and_the_points_the_data() -> None:
    for title, picked in (("Allan deviation in deg/h", "allan"), ("root density", "density")):
        figure = figure_with(title)[0]
        c = compared().channels["gyro_x"]
        per = math.radians(1.0) / 3600.0
        measured = c.allan.deviation if picked == "allan" else np.sqrt(c.spectrum.two_sided)
        points = next(t for t in figure["traces"] if t["name"] == "measured")
        assert numbers(points["y"]) == pytest.approx(measured / per, rel=1e-5)
        drawn = {t["name"]: t for t in figure["traces"]}
        for method in ("allan", "slope", "psd", "gmwm", "ml", "ar", "fos"):
            line = drawn[method]
            theory = getattr(c.theory[method], picked)
            expected = theory if picked == "allan" else np.sqrt(theory)
            assert numbers(line["y"]) == pytest.approx(expected / per, rel=1e-5), method
    # the white part of the density in deg/h/√Hz, at the highest frequencies
    top = numbers(next(t for t in figure["traces"] if t["name"] == "ml")["y"])[-1]
    assert top == pytest.approx(math.degrees(N["gyro"]) * 3600.0, rel=0.05)


def test_autocorrelation_and_ratio_are_drawn_for_every_channel() -> None:
    assert len(figure_with('"text": "autocorrelation"')) == 4  # of signals and of residuals
    ratios = figure_with("model above data in %")
    assert len(ratios) == 2
    allan = next(t for t in ratios[0]["traces"] if t["name"] == "allan")
    short = numbers(allan["x"]) < 5.0
    assert np.abs(numbers(allan["y"])[short]).max() < 8.0


def test_residuals_show_tests_and_a_band_of_the_right_width() -> None:
    table = next(t for c, t in tables().items() if c.startswith("Tests of the one-step"))
    assert {r[1] for r in table.rows} == set(METHODS)
    right = [r for r in table.rows if r[1] in ("ml", "gmwm")]
    assert all(r[-1] == "white" for r in right)
    figure = figure_with("lag in steps")[0]
    band = next(t for t in figure["traces"] if t.get("fill"))
    assert numbers(band["y"]) == pytest.approx(np.full(40, 1.96 / math.sqrt(20_000)), rel=0.1)
    quantiles = figure_with("Gaussian quantile")[0]
    ml = next(t for t in quantiles["traces"] if t["name"] == "ml")
    inner = np.abs(numbers(ml["x"])) < 1.5
    assert numbers(ml["y"])[inner] == pytest.approx(numbers(ml["x"])[inner], abs=0.05)


def test_predictors_and_volatility_have_their_tables_and_plots() -> None:
    captions = " ".join(tables())
    assert "Autoregressive models" in captions
    assert "Fast Orthogonal Search" in captions
    assert "GARCH of the one-step errors" in captions
    volatility = figure_with('"text": "standard deviation in deg/h"')[0]
    model = numbers(next(t for t in volatility["traces"] if t["name"] == "GARCH")["y"])
    sample = math.degrees(N["gyro"] * math.sqrt(RATE)) * 3600.0
    assert float(np.mean(model)) == pytest.approx(sample, rel=0.05)
    assert "Kolmogorov" in json.dumps([t.note for t in tables().values()])


def test_the_page_holds_the_findings_and_nothing_foreign() -> None:
    own = page().replace(plotly_script(), "")
    for name, c in compared().channels.items():
        for text in c.findings:
            assert text.replace("'", "&#39;").replace("<", "&lt;") in own, (name, text)
    assert "http" not in own.replace("http-equiv", "")
    assert "NaN" not in own


def test_one_signal_without_a_unit_has_a_page_too() -> None:
    rng = np.random.default_rng(3)
    found = compare_methods(rng.standard_normal(3000), 10.0, ("psd", "ar"), name="<b>mine</b>")
    text = render_report(found, title="One").replace(plotly_script(), "")
    assert "&lt;b&gt;mine&lt;/b&gt;" in text
    assert "<b>mine" not in text
    assert quantity("white_noise.density", "mine") == ("white noise N", "SI", 1.0)


def test_runs_are_pooled_by_their_weights() -> None:
    model = WhiteNoise(1.0) + RandomWalk(1.0)
    runs = [compare_methods_imu(recording(k), ("allan", "gmwm"), model=model) for k in (1, 2, 3)]
    together = compare_replicates(runs)
    white = next(
        p
        for p in together.parameters
        if (p.channel, p.parameter) == ("gyro_x", "white_noise.density")
    )
    each = [r for r in white.runs["gmwm"] if r is not None]
    weights = [(v / e) ** 2 for v, e in each]
    mean = math.exp(
        sum(w * math.log(v) for w, (v, _) in zip(weights, each, strict=True)) / sum(weights)
    )
    assert white.pooled["gmwm"].value == pytest.approx(mean)
    assert white.pooled["gmwm"].standard_error < min(e for _, e in each)
    assert white.shared
    assert white.agree
    json.dumps(together.to_dict(), allow_nan=False)
    text = render_report(together, title="Pooled").replace(plotly_script(), "")
    assert "Runs pooled and apart" in text
    shown = re.search(r"white noise N</td>.*?deg/√h</td>\s*<td>([\d.]+)\(", text, re.S)
    assert shown
    assert float(shown[1]) == pytest.approx(math.degrees(N["gyro"] * 60.0), rel=0.02)


def test_runs_that_differ_are_told() -> None:
    model = WhiteNoise(1.0)
    loud = recording(2)
    louder = ImuRecording(loud.time, 1.2 * loud.gyro, loud.accel, name="louder")
    runs = [compare_methods_imu(r, ("allan", "psd"), model=model) for r in (recording(1), louder)]
    together = compare_replicates(runs, ["first", "second"])
    white = next(p for p in together.parameters if p.channel == "gyro_x")
    assert not white.shared
    told = [f for f in together.findings if f.startswith("gyro_x: from run to run")]
    assert len(told) == 1
    # 20 % apart: a scatter of ln(1.2)/sqrt(2) about the mean
    assert float(told[0].split(" by ")[1].split(" %")[0]) == pytest.approx(12.9, rel=0.15)


def test_probabilities_are_short() -> None:
    assert probability(0.0342) == "0.034"
    assert probability(3e-9) == "< 10⁻⁶"
    assert probability(4e-4) == "4·10⁻⁴"


def test_denoising_shows_both_curves_and_its_levels() -> None:
    rng = np.random.default_rng(2)
    signal = N["gyro"] * math.sqrt(RATE) * rng.standard_normal(16_384)
    denoised = denoise(signal, level=4, rate=RATE, details="zero")
    effect = allan_effect(signal, RATE, denoised)
    section = denoising_section(effect, denoised, "gyro_x")
    figure = next(b for b in section.blocks if isinstance(b, FigureGrid)).figures[0]
    drawn = {t["name"]: numbers(t["y"]) for t in figure.traces}
    per = math.radians(1.0) / 3600.0
    assert drawn["before"] == pytest.approx(effect.raw.deviation / per, rel=1e-5)
    assert drawn["after"][0] < 0.2 * drawn["before"][0]
    assert drawn["after"][-1] == pytest.approx(drawn["before"][-1], rel=0.03)
    table = next(b for b in section.blocks if isinstance(b, Table))
    assert next(r[1] for r in table.rows) == "5.00 to 10.0"
    assert {r[3] for r in table.rows} == {"all removed"}
    assert {r[4] for r in table.rows} == {"0 %"}
    text = render_report(effect, denoised, title="De-noising")
    assert "keep the white noise density N" in text
