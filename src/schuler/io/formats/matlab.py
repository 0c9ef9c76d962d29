"""MATLAB files of NaveGo (structs of IMU and GNSS) and PSINS (matrices of increments)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, What, damaged, lacking
from schuler.io.formats.decoder_process import decoded_apart
from schuler.io.source import Columns, MemorySource
from schuler.io.trajectories.matlab import write_mat, write_recording

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


def open_mat(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read the struct or the matrix of an IMU or a receiver; all is SI and radians."""
    content = decoded_apart(path, "MATLAB", __name__, "_content")
    nodes = list(_nodes("", content))
    for name, value in nodes:
        if isinstance(value, dict):
            source = _struct(path, name, value, what)
            if source is not None:
                return source
    for name, value in nodes:
        if isinstance(value, np.ndarray) and value.ndim == 2:
            source = _matrix(path, name, value, what)
            if source is not None:
                return source
    shown = ", ".join(n for n, _ in nodes[:12])
    wanted = "t, wb, fb, or a matrix imu of 7 columns" if what == "imu" else "t, lat, lon, h, vel"
    raise InputError(
        f"no {'IMU' if what == 'imu' else 'GNSS'} was found among: {shown}",
        expected=f"a struct of NaveGo with {wanted}, or matrices of PSINS",
        where=str(path),
    )


def _content(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:
        newer = b"MATLAB 7.3" in stream.read(512)
    return _hdf5(path) if newer else _level5(path)


def _level5(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        return dict(loadmat(str(path), simplify_cells=True))
    except Exception as error:  # SciPy raises many kinds for damaged files
        raise damaged(path, "MATLAB", error) from None


def _hdf5(path: Path) -> dict[str, Any]:
    try:
        import h5py
    except ImportError:
        raise lacking("h5py", "matlab", path) from None

    def plain(node: Any) -> Any:
        if isinstance(node, h5py.Group):
            return {k: plain(v) for k, v in node.items() if not k.startswith("#")}
        array = np.asarray(node)
        return np.squeeze(array.T) if array.dtype.kind in "fiu" else None

    try:
        with h5py.File(path) as file:
            return dict(plain(file))
    except Exception as error:  # so does h5py
        raise damaged(path, "MATLAB 7.3", error) from None


def _nodes(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield every struct and array with its name."""
    if name and not name.startswith("__"):
        yield name, value
    if isinstance(value, dict):
        for key, inner in value.items():
            if not str(key).startswith("__"):
                yield from _nodes(f"{name}.{key}" if name else str(key), inner)


def _struct(path: Path, name: str, struct: dict[str, Any], what: What) -> MemorySource | None:
    """Return the IMU or the GNSS of a struct of NaveGo."""
    columns: Columns = {}
    units = {"time": "s"}
    if what == "imu":
        gyro = struct.get("wb", struct.get("w"))
        if gyro is None or "fb" not in struct:
            return None
        for stem, values, unit in (("gyro", gyro, "rad/s"), ("accel", struct["fb"], "m/s^2")):
            table = np.asarray(values, dtype=np.float64)
            table = table if table.shape[-1] == 3 else table.T
            for k, axis in enumerate("xyz"):
                columns[f"{stem}_{axis}"], units[f"{stem}_{axis}"] = table[:, k], unit
    else:
        if not {"lat", "lon", "h"} <= set(struct):
            return None
        for key, role, unit in (("lat", "latitude", "rad"), ("lon", "longitude", "rad"),
                                ("h", "height", "m")):  # fmt: skip
            columns[role], units[role] = np.ravel(struct[key]).astype(np.float64), unit
        _add_three(columns, units, struct.get("vel"), "vel", "m/s")
        _add_three(columns, units, struct.get("stdm"), "pos_std", "m")
        _add_three(columns, units, struct.get("stdv"), "vel_std", "m/s")
    size = next(iter(columns.values())).size
    rate = struct.get("freq")
    if "t" in struct:
        columns["time"] = np.ravel(struct["t"]).astype(np.float64)
    lengths = {c.size for c in columns.values()}
    if len(lengths) != 1:
        raise InputError(f"the fields of '{name}' differ in length", where=str(path))
    stated = float(np.mean(rate)) if rate is not None and np.size(rate) == 1 else None
    said = f"struct '{name}' with {size} rows, as NaveGo writes it"
    return MemorySource(path, columns, units, stated, (said,))


def _add_three(columns: Columns, units: dict[str, str], values: Any, stem: str, unit: str) -> None:
    if values is None:
        return
    table = np.asarray(values, dtype=np.float64)
    size = next(iter(columns.values())).size
    if table.size == 3:
        table = np.tile(table.reshape(1, 3), (size, 1))
    if table.ndim == 2 and table.shape == (size, 3) and np.any(table):
        for k, axis in enumerate(("north", "east", "down")):
            columns[f"{stem}_{axis}"], units[f"{stem}_{axis}"] = table[:, k], unit


def _matrix(path: Path, name: str, table: Any, what: What) -> MemorySource | None:
    """Return the IMU or the GNSS of a matrix of PSINS: its last column is time."""
    if table.shape[1] not in (4, 7) or table.shape[0] < 3 or table.dtype.kind not in "fiu":
        return None
    if not np.all(np.diff(table[:, -1]) > 0.0):
        return None
    step = float(np.median(np.diff(table[:, -1])))
    if what == "imu":
        force = float(np.median(np.linalg.norm(table[:, 3:6], axis=1))) / step
        if table.shape[1] != 7 or not 5.0 < force < 20.0:
            return None
        columns: Columns = {"time": table[:, 6]}
        for k, axis in enumerate("xyz"):
            columns[f"dtheta_{axis}"], columns[f"dvel_{axis}"] = table[:, k], table[:, k + 3]
        units = {n: "rad" if n.startswith("dth") else "m/s" for n in columns} | {"time": "s"}
        said = (f"matrix '{name}': increments of PSINS, axes right, front, up",)
        return MemorySource(path, columns, units, None, said, "row", said)
    place = table[:, -4:-1]
    if np.abs(place[:, 0]).max() > np.pi / 2 or np.abs(place[:, 1]).max() > np.pi:
        return None
    increments = table.shape[1] == 7 and np.abs(place[:, 2]).max() < 2.0 and step < 0.1
    if increments and np.median(np.linalg.norm(table[:, 3:6], axis=1)) / step < 20.0:
        return None
    columns = {"time": table[:, -1]}
    for k, axis in enumerate(("latitude", "longitude", "height")):
        columns[axis] = place[:, k]
    units = {"time": "s", "latitude": "rad", "longitude": "rad", "height": "m"}
    if table.shape[1] == 7:
        for k, axis in enumerate(("east", "north", "up")):
            columns[f"vel_{axis}"], units[f"vel_{axis}"] = table[:, k], "m/s"
    said = (f"matrix '{name}': velocity east, north, up and position of PSINS",)
    return MemorySource(path, columns, units, None, said, "row", said)


FORMATS = (
    Format(
        "mat",
        "a MATLAB file of NaveGo or PSINS",
        (".mat",),
        ("imu", "gnss"),
        magic=(b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"),
        open=open_mat,
        write_trajectory=write_mat,
        write_recording=write_recording,
        extra="matlab",
    ),
)
