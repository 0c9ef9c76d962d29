"""What was recorded: the signals of an IMU, every extreme kept."""

from __future__ import annotations

import numpy as np

from schuler.data.imu import CHANNELS, ImuRecording
from schuler.report.blocks import Facts, FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, envelope, limits
from schuler.report.makers import plot
from schuler.report.numbers import duration, number
from schuler.report.sections.registry import register
from schuler.units import scale

SHOWN_UNITS = {"gyro": ("angular rate", "deg/s"), "accel": ("acceleration", "m/s^2")}


def pretty(unit: str) -> str:
    """Return a unit with typographic powers and roots."""
    for plain, nice in (
        ("^1.5", "^(3/2)"),
        ("^2", "²"),
        ("^3", "³"),
        ("sqrt(Hz)", "√Hz"),
        ("sqrt(h)", "√h"),
        ("sqrt(s)", "√s"),
        ("h^(3/2)", "h/√h"),
        ("ug", "µg"),
    ):
        unit = unit.replace(plain, nice)
    return unit


def channel_title(channel: str) -> str:
    """Return the name of a channel as people write it."""
    sensor, _, axis_name = channel.partition("_")
    return f"{sensor.capitalize()} {axis_name}"


@register
def recording_sections(imu: ImuRecording) -> tuple[Section, ...]:
    """Show an IMU recording."""
    facts = Facts(
        (
            ("Recording", imu.name),
            ("Samples", f"{imu.size:,}".replace(",", "\u202f")),
            ("Rate", f"{imu.rate:.6g} Hz"),
            ("Duration", duration(imu.duration)),
        )
    )
    history = Table(
        "What was done to the data since the file",
        ("step", "what"),
        tuple((str(k + 1), text) for k, text in enumerate(imu.history)),
        words=(0, 1),
        folded=True,
    )
    blocks = (facts, _signals(imu), *((history,) if imu.history else ()))
    return (Section("The recording", blocks),)


def _signals(imu: ImuRecording) -> FigureGrid:
    time = imu.time - imu.time[0]
    figures = []
    for sensor, (kind, unit) in SHOWN_UNITS.items():
        shown = [c for c in CHANNELS if c in imu.channels and c.startswith(sensor)]
        for channel in shown:
            signal = imu.channel(channel)
            factor = scale(unit, kind)
            low, high = float(signal.min()) / factor, float(signal.max()) / factor
            traces = envelope(time, signal / factor, f"@{channel[-1]}", channel_title(channel))
            figures.append(
                plot(
                    channel_title(channel),
                    f"Between {number(low, 4)} and {number(high, 4)} {pretty(unit)}, "
                    f"mean {number(float(np.mean(signal)) / factor, 4)}.",
                    traces,
                    axis("time in s"),
                    axis(pretty(unit), limits=limits([low, high])),
                    height=210,
                )
            )
    legend = tuple(LegendItem(f"{a} axis", f"@{a}") for a in "xyz")
    return FigureGrid(
        tuple(figures),
        legend,
        caption="Drawn from the smallest to the largest value of every stretch: no peak is lost.",
    )
