"""Six runs of one ADIS16405: wavelet moments pooled and apart, with the other methods beside.

    python -m benchmarks.replicates_adis16405 [--runs 1 2 3 4 5 6] [--robust] [--axes gyro_x ...]

Needs the recordings (SCHULER_DATA, or shared/data beside the repository).
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time
from pathlib import Path

import polars as pl

from schuler.estimation.gmwm.replicates import PooledIdentification, fit_gmwm_replicates
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.estimation.maximum_likelihood import fit_maximum_likelihood

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
FOLDER = Path(os.environ.get("SCHULER_DATA", BESIDE)) / "adis16405-static"
COLUMNS = {
    **{f"gyro_{a}": f"gyro_{a}_rad_s" for a in "xyz"},
    **{f"accel_{a}": f"accel_{a}_m_s2" for a in "xyz"},
}


def row(label: str, found: Identification, keys: list[str]) -> str:
    """One line of values with errors."""
    cells = []
    for key in keys:
        value = found.parameters.get(key)
        cells.append(
            f"{'-':>22}" if value is None else f"{value:12.4g} ±{found.standard_errors[key]:8.2g} "
        )
    return f"  {label:18}" + "".join(cells)


def show(name: str, result: PooledIdentification, others: dict[str, Identification]) -> None:
    """Print one channel."""
    keys = list(result.pooled.parameters)
    print(f"{name}\n  {'':18}" + "".join(f"{k[-20:]:>22}" for k in keys))
    print(row("pooled", result.pooled, keys))
    for k, run in enumerate(result.runs):
        print(row(f"run {k + 1}", run, keys))
    for label, other in others.items():
        print(row(label, other, keys))
    print(
        f"  one model? chi-square {result.chi_square:.1f} for {result.degrees_of_freedom}, "
        f"p = {result.p_value:.2g}"
    )
    for agreement in result.agreements:
        print(
            f"    {agreement.parameter}: p = {agreement.p_value:.2g}, "
            f"{100 * agreement.between:.1f} % from run to run"
        )
    for flag in result.pooled.flags:
        print(f"  note: {flag}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6])
    parser.add_argument("--axes", nargs="+", default=list(COLUMNS))
    parser.add_argument("--robust", action="store_true")
    options = parser.parse_args()
    for axis in options.axes:
        column = COLUMNS[axis]
        signals = [
            pl.read_parquet(FOLDER / f"imu{k}.parquet", columns=[column])[column].to_numpy()
            for k in options.runs
        ]
        start = time.process_time()
        result = fit_gmwm_replicates(signals, 100.0, robust=options.robust)
        spent = time.process_time() - start
        # the shortest scale that was fitted: beyond the sensor's own low-pass filter
        block = max(1, round(100.0 * float(result.pooled.diagnostics.tau[0])))
        others: dict[str, Identification] = {
            "run 1, Allan": identify(signals[0], 100.0),
            "run 1, likelihood": fit_maximum_likelihood(
                signals[0], 100.0, result.pooled.process, block=block
            ),
        }
        show(axis, result, others)
        print(f"  CPU s of pooling: {spent:.2f}\n", flush=True)


if __name__ == "__main__":
    main()
