"""Eight gyros of one board: figures 5 and 13 on real chips."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler import ImuArray, Mounting, OnlineSettings, cornered_hat, read_array, synthesize
from schuler_papers.experiment import Numbers, Results, Size, numbers, stacked
from schuler_papers.judging import Found
from schuler_papers.outcome import Curve, Panel

TOP_SIDE, BOTTOM_SIDE = np.eye(3), np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Mountings of the chips on either side of the board."""


def run_recording(seed: int, size: Size, folder: Path) -> Numbers:
    """Fuse two, four and eight gyros of the MIMU board at rest."""
    name = ("run1", "run4", "run7")[seed % 3]
    array = read_array(
        folder / "mimu8-array" / f"{name}.parquet",
        mounting=Mounting(np.tile([TOP_SIDE, BOTTOM_SIDE], (4, 1, 1)), np.zeros((8, 3))),
    )
    quiet = array.between(*still_part(array))
    body = quiet.in_body().gyro
    body = body - body.mean(axis=0)
    hats = [cornered_hat(body[:, :, j]) for j in range(3)]
    own = body.std(axis=0)
    how = OnlineSettings(keep_biases=True, learning=1.0)
    fused = []
    for count in (2, 4, 8):
        found = synthesize(quiet.select(np.arange(count)), "equal", settings=how)
        fused.append(found.sensor("gyro").vectors.std(axis=0))
    variances = np.stack([h.variances for h in hats], axis=1)
    # the hat speaks of axes of the body; on the bottom side x and y of a chip lie across
    variances[1::2] = variances[1::2][:, [1, 0, 2]]
    weighted = synthesize(quiet, covariance={"gyro": variances.ravel()}, settings=how)
    return numbers(
        own=own,
        fused=fused,
        weighted=weighted.sensor("gyro").vectors.std(axis=0),
        hat=np.stack([h.deviations for h in hats], axis=1),
        p_values=[h.p_value for h in hats],
    )


def still_part(array: ImuArray) -> tuple[float, float]:
    """Return the longest part of an array recording at which nothing turned."""
    gyro = array.gyro[:, 0]
    step = max(round(0.5 * array.rate), 1)
    blocks = gyro[: gyro.shape[0] // step * step].reshape(-1, step, 3)
    quiet = blocks.std(axis=1).max(axis=1)
    calm = quiet < 3.0 * np.quantile(quiet, 0.05)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return (
        float(array.time[starts[longest] * step]),
        float(array.time[min(stops[longest] * step, array.size - 1)]),
    )


def recording(results: Results, size: Size) -> Found:
    """Eight real gyros at rest."""
    own, fused = stacked(results, "own"), stacked(results, "fused")
    weighted, hat = stacked(results, "weighted"), stacked(results, "hat")
    law = np.stack([np.sqrt((own[:, :k] ** 2).sum(axis=1)) / k for k in (2, 4, 8)], axis=1)
    values = {
        "over law": (fused / law).mean(axis=2),
        "reduction": (1.0 - fused[:, 1] / own[:, :4].mean(axis=1)).mean(axis=1),
        "spread": own[:, :, 0].max(axis=1) / own[:, :, 0].min(axis=1),
        "weighted": (weighted / fused[:, 2]).mean(axis=1),
        "hat": (hat / own).mean(axis=(1, 2)),
        "independent": float(stacked(results, "p_values").min()),
    }
    places = np.arange(8.0)
    panel = Panel(
        "Eight chips of one board at rest, x axis",
        "",
        "rad/s",
        (
            Curve("own noise", places, own.mean(axis=0)[:, 0], "data", "points"),
            Curve("by the cornered hat", places + 0.1, hat.mean(axis=0)[:, 0], "ours", "points"),
            Curve("mean of eight", places, np.full(8, fused[:, 2, 0].mean()), "paper", "dash"),
            Curve("weighted", places, np.full(8, weighted[:, 0].mean()), "better", "line"),
        ),
        "Noise of eight gyros, of their mean and of their weighted mean.",
        categories=tuple(f"chip {k + 1}" for k in range(8)),
    )
    return Found(values, panels=(panel,))
