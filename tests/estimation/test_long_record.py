"""Noise of records that are read in pieces: as in memory, and what is left out is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler import ImuRecording, NoiseModel, RandomWalk, WhiteNoise, characterize_imu
from schuler.cli.app import run
from schuler.errors import EstimationError, InputError
from schuler.estimation.long_record import NOT_LOOKED_AT, characterize_pieces
from schuler.io import read_imu
from schuler.io.pieces import read_imu_pieces
from schuler.simulation import simulate_static

MODEL = NoiseModel.isotropic(WhiteNoise(5e-5) + RandomWalk(3e-6), WhiteNoise(7e-4))


@pytest.fixture(scope="module")
def still() -> ImuRecording:
    return simulate_static(MODEL, 2000.0, 50.0, np.random.default_rng(41))


def write(imu: ImuRecording, path: Path) -> None:
    columns = {"time_s": imu.time}
    for name, unit, values in (("gyro", "rad_s", imu.gyro), ("accel", "m_s2", imu.accel)):
        columns |= {f"{name}_{a}_{unit}": values[:, k] for k, a in enumerate("xyz")}
    polars.DataFrame(columns).write_parquet(path, row_group_size=10_000)


def test_pieces_of_a_file_are_the_file(still: ImuRecording, tmp_path: Path) -> None:
    write(still, tmp_path / "imu.parquet")
    pieces = list(read_imu_pieces(tmp_path / "imu.parquet", rows=33_333))
    whole = read_imu(tmp_path / "imu.parquet")
    assert len(pieces) == 4
    assert np.array_equal(np.concatenate([p.gyro for p in pieces]), whole.gyro)
    assert np.array_equal(np.concatenate([p.time for p in pieces]), whole.time)


def test_noise_in_pieces_is_the_noise_in_memory(still: ImuRecording) -> None:
    parts = [still.between(500.0 * k, 500.0 * (k + 1)) for k in range(4)]
    pieces, memory = characterize_pieces(parts), characterize_imu(still)
    assert NOT_LOOKED_AT in pieces.findings
    for channel, found in pieces.channels.items():
        other = memory.channels[channel]
        assert {p.kind for p in found.process.parts} == {p.kind for p in other.process.parts}
        for name, value in found.parameters.items():
            # the usual curve ends at a third of the record, this one at a ninth
            assert abs(value - other.parameters[name]) < 0.7 * other.standard_errors[name]
            assert found.standard_errors[name] < 2.0 * other.standard_errors[name]


def test_a_piece_that_moves_is_left_out(still: ImuRecording) -> None:
    parts = [still.between(400.0 * k, 400.0 * (k + 1)) for k in range(5)]
    swing = np.sin(np.arange(parts[2].size) / 20.0)[:, np.newaxis]
    parts[2] = replace(parts[2], gyro=parts[2].gyro + swing, accel=parts[2].accel + 3.0 * swing)
    found = characterize_pieces(parts)
    assert any("1 pieces were left out" in text for text in found.findings)
    density = found.channels["gyro_y"].parameters["white_noise.density"]
    assert density == pytest.approx(5e-5, rel=0.02)
    with pytest.raises(EstimationError, match="moved in all"):
        characterize_pieces(parts[2:3])


def test_a_knock_is_cut_out(still: ImuRecording) -> None:
    accel = still.accel.copy()
    accel[40_000:40_010] += 30.0
    gyro = still.gyro.copy()
    gyro[40_000:40_010] += 2.0
    found = characterize_pieces([replace(still, accel=accel, gyro=gyro)])
    assert any("knocks were cut out" in text for text in found.findings)
    assert found.channels["accel_z"].parameters["white_noise.density"] == pytest.approx(
        7e-4, rel=0.01
    )


def test_pieces_that_do_not_belong_together(still: ImuRecording, tmp_path: Path) -> None:
    halves = [still.between(0.0, 1000.0), still.between(1000.0, 2000.0)]
    slow = replace(halves[1], time=halves[1].time * 2.0)
    with pytest.raises(InputError, match="25 Hz"):
        characterize_pieces([halves[0], slow])
    write(halves[0], tmp_path / "b.parquet")
    write(halves[1], tmp_path / "a.parquet")
    with pytest.raises(InputError, match="order of time"):
        list(read_imu_pieces(tmp_path))
    with pytest.raises(InputError, match="no pieces"):
        characterize_pieces([])


def test_the_command_line_reads_in_pieces(
    still: ImuRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(still, tmp_path / "imu.parquet")
    command = ["characterize", str(tmp_path / "imu.parquet"), "--memory", "5"]
    page = tmp_path / "page.html"
    assert run([*command, "--noise-out", str(tmp_path / "n.yaml"), "--report", str(page)]) == 0
    assert "read in pieces" in capsys.readouterr().out
    assert NoiseModel.load(tmp_path / "n.yaml").rate == pytest.approx(50.0)
    assert page.stat().st_size > 10_000
    assert run([*command, "--rest"]) == 2
