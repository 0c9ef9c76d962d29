"""The picture of the README, of the recordings of `schuler demo`: python docs/site/picture.py."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

import schuler
from schuler.cli.example import example_drive, example_static
from schuler.cli.verbs.demo import DRIVE_SECONDS, OUTAGES
from schuler.evaluation.outages import OutageEvaluation
from schuler.noise import NoiseModel

PICTURE = Path(__file__).parents[1] / "pictures" / "first-look.svg"
BLUE, ORANGE, GREY = "#3366cc", "#d9730d", "#8a8f98"
DEGREES_AN_HOUR = 3600.0 * 180.0 / np.pi
EARTH = 6.37e6


def draw_noise(axes: Axes) -> NoiseModel:
    """Draw the Allan deviation of a gyro with its interval, its model and the parts of that."""
    imu = example_static()
    found = schuler.characterize_imu(imu)
    channel = found.channels["gyro_x"]
    curve = schuler.allan_deviation(imu.gyro[:, 0], imu.rate)
    axes.fill_between(
        curve.tau,
        curve.lower * DEGREES_AN_HOUR,
        curve.upper * DEGREES_AN_HOUR,
        color=BLUE,
        alpha=0.2,
        lw=0,
    )
    axes.loglog(
        curve.tau, curve.deviation * DEGREES_AN_HOUR, ".", ms=3, color=BLUE, label="gyro x, 2 h"
    )
    for part in channel.process.parts:
        deviation = np.sqrt(part.allan_variance(curve.tau)) * DEGREES_AN_HOUR
        axes.loglog(curve.tau, deviation, "--", lw=0.9, color=GREY)
    whole = np.sqrt(channel.process.allan_variance(curve.tau)) * DEGREES_AN_HOUR
    axes.loglog(curve.tau, whole, color=ORANGE, lw=1.4, label="fitted sum")
    axes.set(
        title="1  what the noise is", xlabel="cluster time, s", ylabel="Allan deviation, deg/h",
        ylim=DEGREES_AN_HOUR * np.array([0.4 * curve.deviation.min(), 1.5 * curve.deviation.max()]),
    )  # fmt: skip
    axes.legend(frameon=False, fontsize=8)
    return found.noise_model


def draw_outages(
    track: Axes, error: Axes, found: OutageEvaluation, truth: schuler.Trajectory
) -> None:
    """Draw the road without GNSS, and the errors there beside what was claimed."""
    latitude, longitude = truth.position[:, 0], truth.position[:, 1]
    north = EARTH * (latitude - latitude[0])
    east = EARTH * np.cos(latitude[0]) * (longitude - longitude[0])
    track.plot(east, north, color=GREY, lw=1.2)
    for window in found.causal.windows:
        inside = (truth.time >= truth.time[0] + window.start_s) & (
            truth.time <= truth.time[0] + window.start_s + window.duration_s
        )
        track.plot(east[inside], north[inside], color=ORANGE, lw=2.5)
    track.plot([], [], color=ORANGE, lw=2.5, label="30 s without GNSS")
    track.set(title="2  a drive, GNSS gone", xlabel="east, m", ylabel="north, m")
    track.set_aspect("equal", adjustable="datalim")
    track.legend(frameon=False, fontsize=8)
    for statistics, colour, name in (
        (found.causal, ORANGE, "as it drives"), (found.smoothed, BLUE, "smoothed"),
    ):  # fmt: skip
        time = np.arange(1.0, OUTAGES[0])
        errors, claims = [], []
        for w in statistics.windows:
            since = w.time - w.start_s
            errors.append(np.interp(time, since, w.horizontal_m))
            claims.append(np.interp(time, since, np.sqrt(np.trace(w.covariance, 0, 1, 2))))
        real = np.sqrt(np.mean(np.square(errors), axis=0))
        claimed = np.sqrt(np.mean(np.square(claims), axis=0))
        error.semilogy(time, real, color=colour, lw=1.6, label=f"{name}: real")
        error.semilogy(time, claimed, "--", color=colour, lw=1.2, label="claimed")
    error.set(
        title="3  what it costs, and whether it knows", xlabel="s without GNSS",
        ylabel="horizontal error, RMS, m",
    )  # fmt: skip
    error.legend(frameon=False, fontsize=8)


def main() -> None:
    """Make the picture."""
    mpl.rcParams |= {
        "font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left", "svg.fonttype": "path",
        "axes.spines.top": False, "axes.spines.right": False, "svg.hashsalt": "schuler",
    }  # fmt: skip
    figure, (noise, track, error) = plt.subplots(1, 3, figsize=(11.0, 3.4), layout="constrained")
    model, drive = draw_noise(noise), example_drive(DRIVE_SECONDS)
    found = schuler.evaluate_outages(drive.imu, drive.gnss, model, sweep=OUTAGES)
    draw_outages(track, error, found, drive.truth)
    PICTURE.parent.mkdir(exist_ok=True)
    figure.savefig(PICTURE, metadata={"Date": None}, facecolor="white")


if __name__ == "__main__":
    main()
