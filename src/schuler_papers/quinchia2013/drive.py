"""Seven outages on a real drive with RTK: what models cannot give, and what else does."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler import OutageEvaluation, evaluate_outages, read_gnss, read_imu
from schuler_papers.experiment import Numbers, Results, Size, numbers, stacked
from schuler_papers.judging import Found
from schuler_papers.outcome import Curve, Panel, Role

WINDOWS = tuple((start, 30.0) for start in (120.0, 180.0, 240.0, 300.0, 360.0, 420.0, 480.0))
LEVER_ARM = (0.0, 0.0, 0.0)
"""The antenna is 5 cm from the IMU."""
_ROLES: tuple[Role, ...] = ("paper", "y", "ours", "better")
ANSWERS = ("causal", "smoothed", "causal, wheels", "smoothed, wheels")


def run(seed: int, size: Size, folder: Path) -> Numbers:
    """Withhold RTK seven times from one drive, without and with what is known of the vehicle."""
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


def outages(results: Results, size: Size) -> Found:
    """What noise models leave, and what vehicle and smoother take away."""
    largest = results[0]["largest"]
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
    values = {
        "mean": stacked(results, "largest").mean(axis=2),
        "inside": stacked(results, "inside"),
    }
    return Found(values, panels=(panel,))
