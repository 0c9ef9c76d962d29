"""Noise of records that are read in pieces: as in memory, and what is left out is said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler import (
    ImuRecording,
    NoiseModel,
    RandomWalk,
    WhiteNoise,
    characterize_imu,
    fit_gmwm,
    identify,
    power_spectral_density,
    wavelet_variance,
)
from schuler.cli.app import run
from schuler.curves.spectrum_sums import SEGMENT
from schuler.errors import EstimationError, InputError
from schuler.estimation.gmwm.fit import fit_gmwm_curves
from schuler.estimation.long_record import (
    NOT_LOOKED_AT,
    RecordSums,
    characterize_pieces,
    characterize_sums,
    collect_sums,
)
from schuler.estimation.spectrum.fit import fit_spectrum
from schuler.io import read_imu
from schuler.io.pieces import read_imu_pieces
from schuler.io.trajectories.mcap import write_recording
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


def _table(imu: ImuRecording) -> dict[str, np.ndarray]:  # type: ignore[type-arg]
    signal = {f"gyro_{a}_rad_s": imu.gyro[:, k] for k, a in enumerate("xyz")}
    return {"time_s": imu.time} | signal


def _write_form(form: str, imu: ImuRecording, folder: Path) -> tuple[Path, dict[str, object]]:
    """Write a recording in one of the forms that are read in pieces; how it is to be read."""
    columns, path = _table(imu), folder / f"imu.{form.rpartition('/')[0] or form}"
    how: dict[str, object] = {}
    if form == "csv":
        polars.DataFrame(columns).write_csv(path)
    elif form == "csv/no time":
        polars.DataFrame(columns).drop("time_s").write_csv(path)
        how = {"rate": 50.0}
    elif form == "npz":
        np.savez_compressed(path, **columns)
    elif form == "npz/vector":
        np.savez(path, rate=50.0, gyro=imu.gyro, accel=imu.accel)
    elif form == "npy":
        np.save(path, np.column_stack([*columns.values()]))
        how = {"columns": tuple(columns)}
    elif form == "npy/fields":
        rows = np.empty(imu.size, [(name, "f8") for name in columns])
        for name, values in columns.items():
            rows[name] = values
        np.save(path, rows)
    elif form == "mcap":
        write_recording(path, imu)
    return path, how


@pytest.mark.parametrize(
    "form", ["csv", "csv/no time", "npz", "npz/vector", "npy", "npy/fields", "mcap"]
)
def test_every_form_is_read_in_pieces_as_in_memory(
    form: str, still: ImuRecording, tmp_path: Path
) -> None:
    path, how = _write_form(form, still.between(0.0, 100.0), tmp_path)
    pieces = list(read_imu_pieces(path, rows=1700, **how))
    whole = read_imu(path, **how)
    assert len(pieces) in (3, 4)
    assert max(p.size for p in pieces) < 1800
    for name in ("time", "gyro", "accel"):
        parts = np.concatenate([getattr(p, name) for p in pieces])
        assert np.array_equal(parts, getattr(whole, name), equal_nan=True)


def test_a_dataset_in_partitions_is_one_recording(still: ImuRecording, tmp_path: Path) -> None:
    for day, start in (("2026-01-01", 0.0), ("2026-01-02", 40.0)):
        folder = tmp_path / f"day={day}"
        folder.mkdir()
        write(still.between(start, start + 20.0), folder / "part-0.parquet")
        write(still.between(start + 20.0, start + 40.0), folder / "part-1.parquet")
    pieces = list(read_imu_pieces(tmp_path))
    assert [round(p.time[0]) for p in pieces] == [0, 20, 40, 60]


def test_a_fault_deep_in_a_text_is_told_with_its_line(still: ImuRecording, tmp_path: Path) -> None:
    path, _ = _write_form("csv", still.between(0.0, 100.0), tmp_path)
    lines = path.read_text().splitlines()
    lines[3500] = lines[3500].replace(",", ",oops", 1)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"line 3501, column 'gyro_x_rad_s'"):
        list(read_imu_pieces(path, rows=1000))


def test_one_pass_gives_every_curve_as_in_memory(still: ImuRecording) -> None:
    parts = [still.between(500.0 * k, 500.0 * (k + 1)) for k in range(4)]
    sums = collect_sums(parts, segment=4096)
    column = sums.channels.index("gyro_y")
    signal = still.gyro[:, 1]
    wavelet, memory = sums.allan.wavelet_variance(column), wavelet_variance(signal, still.rate)
    assert wavelet.scale == pytest.approx(memory.scale, rel=1e-9)
    assert wavelet.variance == pytest.approx(memory.variance, rel=1e-9)
    assert wavelet.upper == pytest.approx(memory.upper, rel=1e-3)
    found, other = fit_gmwm_curves([wavelet], "W+K"), fit_gmwm(signal, still.rate, "W+K")
    for name, value in other.parameters.items():
        assert found.parameters[name] == pytest.approx(value, rel=1e-4)
    spectrum = sums.spectrum.curve(column, onesided=False)
    whole = power_spectral_density(signal, still.rate, onesided=False, segment=4096)
    assert spectrum.density == pytest.approx(whole.density, rel=1e-9)
    assert spectrum.upper == pytest.approx(whole.upper, rel=1e-9)


def test_a_clock_that_turns_at_midnight_between_files_goes_on_and_it_is_said(
    still: ImuRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    columns = _table(still.between(0.0, 100.0))
    columns["time_s"] = np.round(columns["time_s"] + 86_340.0, 6) % 86_400.0
    frame, folder = polars.DataFrame(columns), tmp_path / "days"
    folder.mkdir()
    frame[:3000].write_csv(folder / "a.csv")
    frame[3000:].write_csv(folder / "b.csv")
    pieces = list(read_imu_pieces(folder))
    assert pieces[1].time[0] - pieces[0].time[-1] == pytest.approx(0.02)
    out = tmp_path / "week.sums.npz"
    assert run(["characterize", str(folder), "--model", "W", "--sums-out", str(out)]) == 0
    assert "time wraps round at a day" in capsys.readouterr().err
    assert run(["characterize", str(out), "--model", "W", "--json", "-"]) == 0
    assert "time wraps round at a day" in capsys.readouterr().err
    frame[1000:].write_csv(folder / "b.csv")
    with pytest.raises(InputError, match="begins before the one before it ends"):
        list(read_imu_pieces(folder))


def test_methods_on_pieces_on_the_command_line(
    still: ImuRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(still, tmp_path / "imu.parquet")
    where = [str(tmp_path / "imu.parquet"), "--memory", "1", "--model", "W+K", "--json", "-"]
    assert run(["characterize", *where, "--method", "gmwm"]) == 0
    found = json.loads(capsys.readouterr().out)
    memory = fit_gmwm(still.gyro[:, 1], still.rate, "W+K").parameters
    for name, value in memory.items():
        assert found["channels"]["gyro_y"]["parameters"][name]["value"] == pytest.approx(
            value, rel=1e-4
        )
    assert run(["characterize", *where, "--method", "psd"]) == 0
    found = json.loads(capsys.readouterr().out)["channels"]["gyro_y"]
    curve = power_spectral_density(still.gyro[:, 1], still.rate, onesided=False, segment=SEGMENT)
    assert found["method"] == "psd"
    for name, value in fit_spectrum(curve, "W+K").parameters.items():
        assert found["parameters"][name]["value"] == pytest.approx(value, rel=1e-4)
    assert run(["characterize", *where, "--method", "ml"]) == 2
    assert "--method allan, gmwm or psd" in capsys.readouterr().err


def test_sums_of_parts_are_kept_and_added(
    still: ImuRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for k in range(4):
        part = still.between(500.0 * k, 500.0 * (k + 1))
        path = tmp_path / f"{k}.parquet"
        write(part, path)
        out = str(tmp_path / f"{k}.sums.npz")
        assert run(["characterize", str(path), "--sums-out", out]) == 0
    days = [RecordSums.load(tmp_path / f"{k}.sums.npz") for k in range(4)]
    week = characterize_sums(days[0] + days[1] + days[2] + days[3])
    whole = characterize_pieces([still])
    for channel, found in whole.channels.items():
        other = week.channels[channel]
        for name, value in found.parameters.items():
            # what is lost are the clusters across midnight
            assert abs(other.parameters[name] - value) < 0.5 * found.standard_errors[name]
    capsys.readouterr()
    (tmp_path / "0.parquet").unlink()
    assert run(["characterize", str(tmp_path), "--json", str(tmp_path / "week.json")]) == 0
    density = json.loads((tmp_path / "week.json").read_text())["channels"]["gyro_x"]
    assert density["parameters"]["white_noise.density"]["value"] == pytest.approx(
        week.channels["gyro_x"].parameters["white_noise.density"]
    )
    (tmp_path / "0.sums.npz").write_bytes(b"PK nothing of it")
    with pytest.raises(InputError, match="no sums"):
        RecordSums.load(tmp_path / "0.sums.npz")


def test_a_stuck_axis_is_left_out_and_told(still: ImuRecording) -> None:
    parts = [still.between(400.0 * k, 400.0 * (k + 1)) for k in range(5)]
    gyro = parts[1].gyro.copy()
    gyro[:, 2] = gyro[0, 2]
    parts[1] = replace(parts[1], gyro=gyro)
    found = characterize_pieces(parts)
    assert any("1 of 5 pieces were left out" in text for text in found.findings)
    assert any("in 1 of 5 pieces: " in t and "gyro_z" in t for t in found.findings)
    with pytest.raises(EstimationError, match="gyro_z"):
        characterize_pieces(parts[1:2])


def test_noise_in_pieces_is_the_noise_in_memory(still: ImuRecording) -> None:
    parts = [still.between(500.0 * k, 500.0 * (k + 1)) for k in range(4)]
    pieces, memory = characterize_pieces(parts), characterize_imu(still)
    assert NOT_LOOKED_AT in pieces.findings
    for channel, found in pieces.channels.items():
        other = memory.channels[channel]
        assert {p.kind for p in found.process.parts} == {p.kind for p in other.process.parts}
        for name, value in found.parameters.items():
            # the clusters are of other lengths, the longest a third of the record in both
            assert abs(value - other.parameters[name]) < 0.15 * other.standard_errors[name]
            assert found.standard_errors[name] < 1.1 * other.standard_errors[name]


def test_limits_in_pieces_are_those_in_memory() -> None:
    """What is excluded hangs on the longest clusters: those up to a third of the record."""
    white = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    imu = simulate_static(white, 1200.0, 50.0, np.random.default_rng(43))
    found = characterize_pieces([imu.between(0.0, 600.0), imu.between(600.0, 1200.0)])
    memory = identify(imu.gyro[:, 0], imu.rate)
    limits = found.channels["gyro_x"].limits
    for name in ("random_walk.density", "bias_instability.level"):
        assert limits[name] == pytest.approx(memory.limits[name], rel=0.4)


def test_a_folder_of_numbered_files_is_one_recording_without_a_word(
    still: ImuRecording, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for k in range(2):
        write(still.between(500.0 * k, 500.0 * (k + 1)), tmp_path / f"part-{k}.parquet")
    assert run(["characterize", str(tmp_path), "--model", "W+K"]) == 0
    assert "read in pieces" in capsys.readouterr().out
    write(still, tmp_path / "other.parquet")
    assert run(["characterize", str(tmp_path)]) == 2
    assert "name the file itself" in capsys.readouterr().err


def test_a_piece_that_moves_is_left_out(still: ImuRecording) -> None:
    parts = [still.between(400.0 * k, 400.0 * (k + 1)) for k in range(5)]
    swing = np.sin(np.arange(parts[2].size) / 20.0)[:, np.newaxis]
    parts[2] = replace(parts[2], gyro=parts[2].gyro + swing, accel=parts[2].accel + 3.0 * swing)
    found = characterize_pieces(parts)
    assert any("1 of 5 pieces were left out" in text for text in found.findings)
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
