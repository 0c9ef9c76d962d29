"""The whole verb on twins: alignment, time offsets, mounting and noise found from the drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest
from twins import GYRO, LEVER, NOISE, navigation_errors, perfect, with_noise

from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.errors import InputError
from schuler.navigation.aiding.options import WHITE_ERRORS
from schuler.navigation.navigate import navigate
from schuler.navigation.preparation.alignment import align
from schuler.navigation.tuning.likelihood import end_of_enough_motion, velocity_lag
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_euler, rotation_vector_from_dcm
from schuler.simulation import Profile, car_urban, simulate_gnss

# vehicle from IMU: turned by 70 degrees about the vertical, and leaning
MOUNTING = dcm_from_euler(*np.radians([5.0, -8.0, 70.0]))
LATE, VELOCITY_LATE = 0.18, 0.31


@dataclass(frozen=True, eq=False)
class Drive:
    profile: Profile
    imu: ImuRecording
    gnss: GnssRecording


def a_drive(seed: int, *, standstill: float = 20.0, claimed_scale: float = 1.0) -> Drive:
    rng = np.random.default_rng(seed)
    profile = car_urban(300.0, 3, standstill=standstill)
    ideal = perfect(profile)
    turned = replace(ideal, gyro=ideal.gyro @ MOUNTING, accel=ideal.accel @ MOUNTING)
    imu, _ = with_noise(turned, NOISE, rng)
    gnss = simulate_gnss(
        profile,
        2.0,
        position_sd=0.3,
        velocity_sd=0.05,
        lever_arm=LEVER,
        rng=rng,
        latency=LATE,
        velocity_latency=VELOCITY_LATE,
        claimed_scale=claimed_scale,
    )
    return Drive(profile, imu, gnss)


def root_mean_square(drive: Drive, solution: NavigationSolution, since: float) -> np.ndarray:
    path = solution.trajectory
    late = path.time > since
    e = navigation_errors(
        drive.profile,
        path.time[late],
        path.position[late],
        path.velocity[late],
        path.rotation[late] @ MOUNTING.T,
    )
    return np.sqrt(np.mean(e**2, axis=0))


ARM = MOUNTING.T @ LEVER


@pytest.mark.parametrize("seed", [1, 2])
def test_a_drive_with_late_gnss_and_a_turned_imu(seed: int) -> None:
    drive = a_drive(seed)
    solution = navigate(drive.imu, drive.gnss, NOISE, lever_arm=ARM)
    found = solution.settings
    # a fix stamped t belongs to t - late; 0.3 m at 10 m/s over 500 fixes tell 1.5 ms
    assert found["time_offset_position_s"] == pytest.approx(-LATE, abs=5e-3)
    assert found["time_offset_velocity_s"] == pytest.approx(-VELOCITY_LATE, abs=5e-3)
    np.testing.assert_allclose(found["mounting_deg"], [5.0, -8.0, 70.0], atol=0.3)
    # nothing was tuned but the offsets, and the innovations are as large as claimed
    assert found["gnss_position_sd_factor"] == 1.0
    assert found["nis_over_degrees"] == pytest.approx(1.0, abs=0.06)
    rms = root_mean_square(drive, solution, 60.0)
    assert rms[:3].max() < 0.2
    assert rms[3:6].max() < 0.04
    assert np.degrees(rms[6:8]).max() < 0.15
    assert np.degrees(rms[8]) < 0.5


def test_the_receivers_own_standard_deviations_are_put_right() -> None:
    drive = a_drive(4, claimed_scale=2.0)
    solution = navigate(drive.imu, drive.gnss, lever_arm=ARM, measurements=WHITE_ERRORS)
    found = solution.settings
    # 1700 values of each kind: their deviation is known to 2 %, of correlated residuals to more
    assert found["gnss_position_sd_factor"] == pytest.approx(0.5, rel=0.08)
    assert found["gnss_velocity_sd_factor"] == pytest.approx(0.5, rel=0.08)
    assert found["nis_over_degrees"] == pytest.approx(1.0, abs=0.05)
    assert found["time_offset_position_s"] == pytest.approx(-LATE, abs=5e-3)
    assert root_mean_square(drive, solution, 60.0)[:3].max() < 0.2


def test_an_outage_ends_as_far_off_as_claimed_without_knowing_the_sensor() -> None:
    squares = []
    for seed in range(4):
        drive = a_drive(seed)
        solution = navigate(
            drive.imu, drive.gnss, lever_arm=ARM, outages=[(100.0, 30.0), (200.0, 30.0)]
        )
        path = solution.trajectory
        k = np.searchsorted(path.time, [130.0, 230.0])
        e = navigation_errors(
            drive.profile, path.time[k], path.position[k], path.velocity[k], path.rotation[k]
        )[:, :2]
        c = solution.position_covariance[k][:, :2, :2]
        squares += np.einsum("ki,ki->k", e, np.linalg.solve(c, e[..., None])[..., 0]).tolist()
    # 16 degrees of freedom: 1e-4 on either side, and room for the noise found only roughly
    assert 2.0 < np.sum(squares) < 45.0


def test_a_long_drive_is_searched_for_its_time_offset_as_far_as_it_has_moved_enough() -> None:
    time = np.arange(4000.0)
    # parked for 1000 s, then 10 m/s to the north with a stop of 100 s
    speed = np.where((time < 1000.0) | ((time > 1500.0) & (time <= 1600.0)), 0.0, 10.0)
    latitude = 0.7 + np.cumsum(speed) / 6.37e6
    position = np.column_stack([latitude, np.zeros(4000), np.zeros(4000)])
    gnss = GnssRecording(time, position)
    assert end_of_enough_motion(gnss) == pytest.approx(1400.0, abs=2.0)
    assert end_of_enough_motion(gnss.select(time < 1300.0)) == 1299.0


def test_velocity_lag_shows_in_gnss_alone_with_its_sign() -> None:
    rng = np.random.default_rng(6)
    profile = car_urban(300.0, 3, standstill=20.0)
    gnss = simulate_gnss(
        profile, 5.0, position_sd=0.01, velocity_sd=0.02, rng=rng, velocity_latency=0.2
    )
    assert velocity_lag(gnss) == pytest.approx(0.2, abs=0.02)
    early = simulate_gnss(
        profile, 5.0, position_sd=0.01, velocity_sd=0.02, rng=rng, latency=0.3, velocity_latency=0.2
    )
    assert velocity_lag(early) == pytest.approx(-0.1, abs=0.02)


def test_a_start_in_motion_finds_the_attitude() -> None:
    drive = a_drive(7)
    # the first seconds of driving: no rest before it
    imu = drive.imu.between(26.0, np.inf)
    gnss = drive.gnss.select(drive.gnss.time > 26.5)
    solution = navigate(imu, gnss, NOISE, lever_arm=ARM, time_offset=(-LATE, -VELOCITY_LATE))
    assert "motion" in solution.settings["alignment"]
    rms = root_mean_square(drive, solution, 120.0)
    assert rms[:3].max() < 0.3
    assert np.degrees(rms[6:8]).max() < 0.3
    assert np.degrees(rms[8]) < 1.0


def test_alignment_in_motion_is_as_good_as_it_claims() -> None:
    # through corners, bends and braking; the gyros have 0.1 deg/s of bias
    drive = a_drive(7)
    normalised = []
    for start in np.arange(24.0, 280.0, 16.0):
        imu = drive.imu.between(start, np.inf)
        gnss = drive.gnss.select(drive.gnss.time > start + 0.5)
        found = align(imu, gnss, velocity_offset=-VELOCITY_LATE)
        truth = drive.profile.trajectory(imu.time[:1])
        psi = -rotation_vector_from_dcm(found.rotation @ (truth.rotation[0] @ MOUNTING).T)
        assert np.degrees(np.abs(psi[:2])).max() < 3.0
        assert np.degrees(abs(psi[2])) < 10.0
        assert np.linalg.norm(found.velocity - truth.velocity[0]) < 2.0
        normalised.append(psi[2] / found.heading_sd)
    assert len(normalised) == 16
    assert np.abs(normalised).max() < 3.0
    assert np.sqrt(np.mean(np.square(normalised))) < 1.3


def test_smoothing_is_by_all_or_by_a_lag() -> None:
    drive = a_drive(9)

    def solved(smooth: bool | Literal["fixed-lag"]) -> NavigationSolution:
        return navigate(
            drive.imu,
            drive.gnss,
            NOISE,
            lever_arm=ARM,
            time_offset=(-LATE, -VELOCITY_LATE),
            outages=[(150.0, 20.0)],
            smooth=smooth,
            lag=8.0,
        )

    causal, lagged, smoothed = solved(False), solved("fixed-lag"), solved(True)
    assert (lagged.settings["smoothing"], lagged.settings["lag_s"]) == ("fixed lag", 8.0)
    assert smoothed.settings["smoothing"] == "fixed interval"
    assert 1e6 < smoothed.settings["smoother_bytes"] < 2e7
    # sixteen seconds into the outage its end is within the lag; after eight it is not
    path = causal.trajectory.time
    began = float(drive.gnss.time[0]) + 150.0 - LATE
    late, early = np.searchsorted(path, [began + 16.0, began + 8.0])
    sd = [np.linalg.norm(s.position_sd[:, :2], axis=1) for s in (causal, lagged, smoothed)]
    assert sd[1][late] < 0.5 * sd[0][late]
    assert sd[1][late] < 1.3 * sd[2][late]
    assert sd[1][early] > 0.9 * sd[0][early]
    errors = [root_mean_square(drive, s, 100.0)[:2].max() for s in (causal, lagged, smoothed)]
    assert errors[2] < errors[1] < errors[0]
    with pytest.raises(InputError, match="fixed-lag"):
        solved("lagged")  # type: ignore[arg-type]


def test_gnss_without_velocity_and_with_a_missing_component_is_enough() -> None:
    drive = a_drive(8)
    gnss = replace(drive.gnss, velocity=None, velocity_sd=None)
    solution = navigate(drive.imu, gnss, NOISE, lever_arm=ARM, time_offset=-LATE, turn_on_gyro=0.01)
    assert set(solution.innovations.kind) == {"GNSS position"}
    assert root_mean_square(drive, solution, 90.0)[:3].max() < 0.35
    # a receiver that gives no vertical velocity
    sd = np.array(drive.gnss.velocity_sd)
    sd[:, 2] = np.inf
    solution = navigate(
        drive.imu,
        replace(drive.gnss, velocity_sd=sd),
        NOISE,
        lever_arm=ARM,
        time_offset=(-LATE, -VELOCITY_LATE),
    )
    kinds = np.array(solution.innovations.kind)
    assert set(solution.innovations.degrees[kinds == "GNSS velocity"]) == {2}
    assert solution.settings["nis_over_degrees"] == pytest.approx(1.0, abs=0.06)


def test_a_given_heading_at_rest_needs_no_motion_and_stays() -> None:
    rng = np.random.default_rng(9)
    from schuler.simulation import static

    profile = static(60.0, roll=0.05, pitch=-0.1, yaw=1.2)
    # a gyro good enough that the heading stays what it was given as
    quiet = NoiseModel(processes=dict(NOISE.processes) | {"gyro_z": GYRO}, source="twin")
    imu, _ = with_noise(perfect(profile), quiet, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    # the heading of the x axis, which pitch does not turn
    solution = navigate(imu, gnss, quiet, heading=1.2, time_offset=0.0)
    path = solution.trajectory
    truth = profile.trajectory(path.time[:1])
    ahead = path.rotation[0][:, 0]
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(1.2, abs=1e-6)
    # levelled to the accelerometers: 0.05 m/s² of switch-on bias is 0.3 degrees
    np.testing.assert_allclose(path.rotation[0], truth.rotation[0], atol=0.02)
    assert solution.settings["initial_heading_sd_deg"] == pytest.approx(2.0)
