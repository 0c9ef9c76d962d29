"""An odometer holds the road when GNSS is gone, and is held against GNSS before it is believed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars
import pytest

import schuler
from schuler import GnssRecording, MeasurementOptions, NoiseModel, Odometer
from schuler.cli.app import run
from schuler.errors import InputError
from schuler.navigation.aiding.odometer import odometer_checked
from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu

SCALE, DELAY, SD = 1.01, 0.08, 0.05
NOISE = NoiseModel.isotropic(
    schuler.WhiteNoise(2e-4) + schuler.RandomWalk(1e-5),
    schuler.WhiteNoise(2e-3) + schuler.RandomWalk(3e-4),
)
Drive = tuple[schuler.ImuRecording, GnssRecording, np.ndarray, np.ndarray]  # type: ignore[type-arg]


@pytest.fixture(scope="module")
def drive() -> Drive:
    """A drive through a town, and its true speed ten times a second."""
    profile = car_urban(260.0, 12, standstill=20.0)
    rng = np.random.default_rng(12)
    imu = simulate_imu(ideal_imu(profile, 50.0), NOISE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=1.0, velocity_sd=0.05, rng=rng, start=1.0)
    time = np.arange(imu.time[0] + 0.2, imu.time[-1], 0.1)
    speed = np.linalg.norm(profile.trajectory(time - DELAY).velocity, axis=1)
    return imu, gnss, time, SCALE * speed + SD * rng.standard_normal(time.size)


def worst(drive: Drive, *sources: Odometer) -> tuple[float, schuler.NavigationSolution]:
    imu, gnss, _, _ = drive
    window = (160.0, 60.0)
    solution = schuler.navigate(
        imu, gnss, NOISE, outages=[window], time_offset=0.0,
        measurements=MeasurementOptions(sources=sources),
    )  # fmt: skip
    judged = schuler.judge_window(
        solution, gnss, window, lever_arm=np.zeros(3), time_offset=0.0, sd_factor=1.0
    )
    return judged.max_m, solution


def test_an_outage_of_a_minute_costs_a_fraction(drive: Drive) -> None:
    _, _, time, speed = drive
    alone, _ = worst(drive)
    held, solution = worst(drive, Odometer(time, speed, SD))
    assert held < 0.35 * alone
    names = list(solution.sensor_error_names)
    for name, truth in (("odometer scale error", SCALE - 1.0), ("odometer delay", DELAY)):
        k = names.index(name)
        value, sd = solution.sensor_errors[-1, k], solution.sensor_errors_sd[-1, k]
        assert abs(value - truth) < 3.5 * sd
        assert sd < 0.35 * {"odometer delay": 0.1}.get(name, 0.03)
    odometer = solution.innovations.of_kind("odometer")
    assert odometer.nis.size > 500
    assert odometer.mean_nis == pytest.approx(1.0, abs=0.15)


def test_what_gnss_says_against_it(drive: Drive) -> None:
    _, gnss, time, speed = drive
    kept, same, remarks = odometer_checked(time, speed, gnss)
    assert np.array_equal(same, np.abs(speed)) and kept.size == time.size and not remarks
    with pytest.raises(InputError, match=r"in km/h"):
        odometer_checked(time, 3.6 * speed, gnss)
    with pytest.raises(InputError, match=r"2\.\d s behind GNSS"):
        odometer_checked(time + 2.5, speed, gnss)
    with pytest.raises(InputError, match="does not follow"):
        odometer_checked(time, np.random.default_rng(1).uniform(0.0, 15.0, time.size), gnss)
    with pytest.raises(InputError, match=r"1\.3\d? times"):
        odometer_checked(time, 1.3 * speed, gnss)
    sticks = speed.copy()
    sticks[1200:1500] = sticks[1200]
    kept, _, remarks = odometer_checked(time, sticks, gnss)
    assert "sticks in 30" in remarks[0]
    assert kept.size == time.size - 300
    # backwards is a sign, and counts are metres by GNSS
    assert odometer_checked(time, -speed, gnss)[1].min() >= 0.0
    _, metres, remarks = odometer_checked(time, 50.0 * speed, gnss, counts=True)
    assert "one count of the odometer is 0.0" in remarks[0]
    assert np.median(metres[speed > 2.0] / speed[speed > 2.0]) == pytest.approx(
        1.0 / SCALE, rel=0.01
    )


@pytest.mark.parametrize("form", ["speed", "wheels", "ticks", "kmh", "unnamed"])
def test_the_command_line(
    drive: Drive, tmp_path: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    imu, gnss, time, speed = drive
    columns = {"time_s": time}
    if form == "wheels":
        columns |= {"left_speed_m_s": speed - 0.1, "right_speed_m_s": speed + 0.1}
    elif form == "ticks":
        columns["ticks"] = np.floor(np.cumsum(np.abs(speed)) * 0.1 * 400.0)
    elif form == "kmh":
        columns["speed_m_s"] = 3.6 * speed
    else:
        columns["speed_m_s" if form == "speed" else "speed"] = speed
    polars.DataFrame(columns).write_csv(tmp_path / "odometer.csv")
    table = {"time_s": imu.time}
    for name, unit, values in (("gyro", "rad_s", imu.gyro), ("accel", "m_s2", imu.accel)):
        table |= {f"{name}_{a}_{unit}": values[:, k] for k, a in enumerate("xyz")}
    polars.DataFrame(table).write_parquet(tmp_path / "imu.parquet")
    assert gnss.velocity is not None and gnss.velocity_sd is not None
    fixes = {"time_s": gnss.time, "latitude_rad": gnss.position[:, 0]}
    fixes |= {"longitude_rad": gnss.position[:, 1], "height_m": gnss.position[:, 2]}
    for k, a in enumerate(("north", "east", "down")):
        fixes[f"velocity_{a}_m_s"] = gnss.velocity[:, k]
    polars.DataFrame(fixes).write_csv(tmp_path / "gnss.csv")
    NOISE.save(tmp_path / "noise.yaml")
    files = [f"--{k}={tmp_path / n}" for k, n in (("imu", "imu.parquet"), ("gnss", "gnss.csv"))]
    more = ["--gnss-position-sd", "1", "--gnss-velocity-sd", "0.05", "--time-offset", "0"]
    code = run(
        ["navigate", *files, "--noise", str(tmp_path / "noise.yaml"), *more,
         "--odometer", str(tmp_path / "odometer.csv")]
    )  # fmt: skip
    told = capsys.readouterr()
    if form == "kmh":
        assert code == 2 and "km/h" in told.err
    elif form == "unnamed":
        assert code == 2 and "does not say its unit" in told.err
    else:
        assert code == 0 and "odometer" in told.out
        assert ("one count of the odometer is 0.002" in told.err) == (form == "ticks")
