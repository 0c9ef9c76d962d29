"""Seven outages on a real drive with RTK: what models cannot give, and what else does."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler.evaluation.outages import OutageEvaluation, evaluate_outages
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Role, Row

WINDOWS = tuple((start, 30.0) for start in (120.0, 180.0, 240.0, 300.0, 360.0, 420.0, 480.0))
LEVER_ARM = (0.0, 0.0, 0.0)
"""The antenna is 5 cm from the IMU."""
_ROLES: tuple[Role, ...] = ("paper", "y", "ours", "better")
ANSWERS = ("causal", "smoothed", "causal, wheels", "smoothed, wheels")


def run(seed: int, size: Size, folder: Path) -> Numbers:
    """Withhold RTK seven times from one drive, without and with what is known of the vehicle."""
    from schuler.io import read_gnss, read_imu

    imu = read_imu(folder / "rtk-drive" / "imu.parquet")
    gnss = read_gnss(folder / "rtk-drive" / "gnss.parquet")
    found: list[OutageEvaluation] = [
        evaluate_outages(imu, gnss, windows=WINDOWS, lever_arm=LEVER_ARM, aiding=aiding)
        for aiding in ((), ("nhc", "zupt"))
    ]
    answers = [a for e in found for a in (e.causal, e.smoothed)]
    return numbers(
        largest=[[w.max_m for w in a.windows] for a in answers],
        claimed=[[w.claimed_sd_m for w in a.windows] for a in answers],
        inside=[a.within_2_sigma for a in answers],
    )


def outages(results: Results, size: Size) -> Outcome:
    """What noise models leave, and what vehicle and smoother take away."""
    largest, inside = results[0]["largest"], results[0]["inside"]
    mean = largest.mean(axis=1)
    bands = (
        Band(10.0, 30.0, "frozen", "15.3 m when frozen"),
        Band(0.5, 1.1, "frozen", "0.84 m when frozen"),
        Band(1.5, 4.0, "frozen", "2.56 m when frozen"),
        Band(0.2, 0.5, "frozen", "0.30 m when frozen"),
    )
    words = (
        "GNSS and inertial, noise tuned on the rest of the drive",
        "the same, smoothed",
        "with rolling and standing known (nhc, zupt)",
        "the same, smoothed",
    )
    rows = [
        Row(
            f"{text}: mean of the largest errors in seven outages of 30 s",
            float(mean[k]),
            30.6 if k == 0 else None,
            "reproduced in kind" if k == 0 else "beyond the paper",
            unit="m",
            band=bands[k],
            reason="printed: 18AV, five outages of 30 s, another car and another IMU"
            if k == 0
            else "seven kind windows; schuler outages --sweep 30:10 is the fairer judge",
        )
        for k, text in enumerate(words)
    ]
    rows += [
        Row(
            f"share of epochs inside 2 σ, {name}",
            float(inside[k]),
            verdict="beyond the paper",
            band=Band(0.85, 1.0, "spec", "0.954 for an honest filter"),
        )
        for k, name in enumerate(ANSWERS)
    ]
    places = np.arange(float(len(WINDOWS)))
    panel = Panel(
        "Seven outages of 30 s on a drive with RTK",
        "outage",
        "largest horizontal error, m",
        tuple(
            Curve(name, places, largest[k], role, "points")
            for k, (name, role) in enumerate(zip(ANSWERS, _ROLES, strict=True))
        ),
        "Largest error of each outage by four answers.",
        log_y=True,
        categories=tuple(str(k + 1) for k in range(len(WINDOWS))),
    )
    note = (
        "No model of sensor noise gets below the white-noise floor of an outage. What is known of "
        "the vehicle, and a smoother where the answer may wait, take off one and two orders."
    )
    return Outcome(tuple(rows), (panel,), (note,))
