"""`schuler export`: noise models and trajectories in the form other programs read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from schuler.cli.job import Job, Result
from schuler.cli.options.files import Written
from schuler.errors import InputError

Target = Literal["kalibr", "yaml", "si", "csv", "parquet"]


def export(
    source: Path,
    target: Path,
    /,
    *,
    to: Target | None = None,
    rate: float | None = None,
    topic: str = "/imu0",
) -> int:
    """Write a noise model or a trajectory in another form.

    Example: `schuler export noise.yaml imu.yaml --to kalibr`

    Parameters
    ----------
    source : Path
        Noise model (.yaml) or trajectory (.parquet) to read.
    target : Path
        File to write.
    to : {"kalibr", "yaml", "si", "csv", "parquet"}, optional
        For a noise model: kalibr (imu.yaml), yaml (datasheet units, the default) or si; for a
        trajectory: csv or parquet (default: by the ending of the target).
    rate : float, optional
        Samples a second for Kalibr, where the noise model does not know it.
    topic : str
        Name of the ROS topic for Kalibr.
    """
    job = Job(Written(), target, inputs=(source,))
    ending = source.suffix.lower()
    if ending in {".yaml", ".yml"}:
        text = _noise_model(source, to or "yaml", rate, topic)
        return job.finish(Result(texts=((target, lambda: text),)))
    if ending == ".parquet":
        return job.finish(Result(files=((target, _trajectory(source, target, to)),)))
    raise InputError(
        f"ending '{source.suffix}' is not known",
        expected="a noise model (.yaml) or a trajectory (.parquet)",
        where=str(source),
    )


def _noise_model(source: Path, to: Target, rate: float | None, topic: str) -> str:
    from schuler.noise import NoiseModel

    if to in ("csv", "parquet"):
        raise InputError(f"a noise model as {to}", expected="kalibr, yaml or si")
    model = NoiseModel.load(source)
    if to != "kalibr":
        return model.to_yaml("si" if to == "si" else "datasheet")
    from schuler.io.kalibr import kalibr_yaml

    rate = rate if rate is not None else model.rate
    if rate is None:
        raise InputError(
            "the noise model does not know the rate of its IMU",
            expected="--rate HZ",
            where=str(source),
        )
    return kalibr_yaml(model, rate=rate, topic=topic)


def _trajectory(source: Path, target: Path, to: Target | None) -> Callable[[Path], None]:
    from schuler.io.trajectory import check_trajectory_name, read_columns, write_columns

    if to not in (None, "csv", "parquet"):
        raise InputError(f"a trajectory as {to}", expected="csv or parquet", where=str(source))
    form = f".{to}" if to else target.suffix.lower()
    if not to:
        check_trajectory_name(target)
    columns = read_columns(source)
    return lambda path: write_columns(path, columns, form)
