"""Six runs of one ADIS16405 by four methods, one page each and one pooled; MTi-G robust or plain.

    python examples/replicates_adis16405.py OUT_FOLDER [--runs 1 2 3 4 5 6] [--channels gyro_x ...]

Needs the recordings (SCHULER_DATA, or shared/data beside the repository). The structure of each
channel is the one that wavelet moments choose for all runs together, so that parameters mean the
same in every run and by every method.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import numpy as np
import polars as pl

from schuler.data.imu import ImuRecording
from schuler.data.table import write_text
from schuler.estimation.comparison.methods import ImuMethodComparison, compare_methods
from schuler.estimation.comparison.replicates import compare_replicates
from schuler.estimation.gmwm.replicates import PooledIdentification, fit_gmwm_replicates
from schuler.io import read_imu
from schuler.report import Section, Table, record_provenance, write_report
from schuler.report.sections.noise.method_words import shown_name
from schuler.report.sections.noise.residuals import probability
from schuler.screening.screen import repair, screen

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
FOLDER = Path(os.environ.get("SCHULER_DATA", BESIDE))
METHODS = ("allan", "psd", "gmwm", "ml")
RATE = 100.0


def read_run(number: int) -> ImuRecording:
    """One run, with knocks cut out."""
    imu = read_imu(FOLDER / "adis16405-static" / f"imu{number}.parquet", rate=RATE)
    return repair(imu, screen(imu), close_up=True)


def one_model_section(pooled: dict[str, PooledIdentification]) -> Section:
    """Whether one model serves all runs, by wavelet moments."""
    rows = tuple(
        (
            shown_name(name),
            " + ".join(p.kind.replace("_", " ") for p in found.pooled.process.parts),
            f"{found.chi_square:.1f}",
            str(found.degrees_of_freedom),
            probability(found.p_value),
            "yes" if found.shared else "no",
        )
        for name, found in pooled.items()
    )
    table = Table(
        "Wavelet moments with one model for all runs",
        ("channel", "structure", "chi-square", "degrees of freedom", "p", "one model"),
        rows,
        words=(0, 1),
    )
    return Section("One model for all runs?", (table,))


def compare_run(imu: ImuRecording, pooled: dict[str, PooledIdentification]) -> ImuMethodComparison:
    """All methods on all channels of one run, with the structure that all runs share."""
    channels = {
        name: compare_methods(
            imu.channel(name), imu.rate, METHODS, model=found.pooled.process, name=name
        )
        for name, found in pooled.items()
    }
    return ImuMethodComparison(imu.name, channels, imu.rate, imu.duration)


def write_contaminated(out: Path) -> None:
    """The MTi-G gyro with its outliers: robust against plain."""
    path = FOLDER / "mtig-gyro-static" / "gyro_x.parquet"
    signal = pl.read_parquet(path)["gyro_x_rad_s"].to_numpy()
    methods = ("allan", "psd", "gmwm", "gmwm-robust", "ml", "garch")
    found = compare_methods(signal, RATE, methods, name="gyro_x")
    write_report(
        out / "mtig.html",
        found,
        title="MTi-G gyro with contamination: robust against plain",
        provenance=record_provenance(inputs=(path,)),
    )
    print("MTi-G", *found.findings, sep="\n  ", flush=True)


def main() -> None:
    """Write all pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--runs", type=int, nargs="+", default=[1, 2, 3, 4, 5, 6])
    parser.add_argument("--channels", nargs="+")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    write_contaminated(options.out)
    imus = [read_run(k) for k in options.runs]
    pooled: dict[str, PooledIdentification] = {}
    for name in options.channels or imus[0].channels:
        pooled[name] = fit_gmwm_replicates([np.array(i.channel(name)) for i in imus], RATE)
        print(name, pooled[name].pooled.process, f"p = {pooled[name].p_value:.2g}", flush=True)
    compared = []
    for number, imu in zip(options.runs, imus, strict=True):
        found = compare_run(imu, pooled)
        compared.append(found)
        path = options.out / f"run{number}.html"
        write_report(path, found, imu, title=f"ADIS16405, run {number}: {', '.join(METHODS)}")
        print(path, *found.findings, sep="\n  ", flush=True)
    together = compare_replicates(compared, [f"run {k}" for k in options.runs])
    write_report(
        options.out / "pooled.html",
        together,
        one_model_section(pooled),
        title=f"ADIS16405: {len(imus)} runs pooled and apart",
    )
    write_text(options.out / "pooled.json", json.dumps(together.to_dict(), indent=2))
    print("pooled", *together.findings, sep="\n  ")


if __name__ == "__main__":
    main()
