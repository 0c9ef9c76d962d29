"""The verbs on a few samples: every kernel is called once with the types of real use."""

from __future__ import annotations

from collections.abc import Callable


def _characterize() -> None:
    import numpy as np

    from schuler.cli.example import EXAMPLE_RATE, example_noise
    from schuler.estimation.characterization import characterize_imu
    from schuler.screening.screen import screen
    from schuler.simulation import simulate_static

    log = simulate_static(example_noise(), 120.0, EXAMPLE_RATE, np.random.default_rng(1))
    screen(log)
    characterize_imu(log)


def _navigate() -> None:
    from schuler.cli.example import example_drive, example_noise
    from schuler.navigation.navigate import navigate

    drive = example_drive(120.0, standstill=20.0)
    navigate(drive.imu, drive.gnss, example_noise(), smooth=True)
    navigate(drive.imu, drive.gnss, example_noise(), smooth="fixed-lag", lag=1.0)
    navigate(drive.imu, drive.gnss)  # without a noise model the drive tunes it


def _methods() -> None:
    import numpy as np

    from schuler.cli.example import EXAMPLE_RATE, example_noise
    from schuler.estimation.comparison.methods import compare_methods
    from schuler.estimation.identify import METHODS

    signal = (
        example_noise()
        .process("accel_x")
        .simulate(20_000, 1.0 / EXAMPLE_RATE, np.random.default_rng(2))
    )
    compare_methods(signal, EXAMPLE_RATE, tuple(METHODS))


def _outages() -> None:
    from schuler.cli.example import example_drive, example_noise
    from schuler.evaluation.outages import evaluate_outages

    drive = example_drive(120.0, standstill=20.0)
    evaluate_outages(drive.imu, drive.gnss, example_noise(), windows=((60.0, 10.0),))


def _arrays() -> None:
    import numpy as np

    from schuler.arrays.clocks.jumps import find_jumps
    from schuler.data import ImuArray, Mounting

    rng = np.random.default_rng(3)
    time = np.arange(1000) / 100.0
    wave = np.sin(2.0 * np.pi * np.array([0.4, 0.7, 1.1]) * time[:, None])
    rates = wave[:, None] + 1e-3 * rng.standard_normal((1000, 3, 3))
    find_jumps(ImuArray(time, rates, np.zeros((1000, 3, 3)), Mounting.aligned(3)))


def _mechanizations() -> None:
    import numpy as np

    from schuler.cli.example import EXAMPLE_RATE, example_noise
    from schuler.data import ImuArray, Mounting
    from schuler.evaluation.mechanizations import compare_mechanizations
    from schuler.navigation.mechanizations.array_preparation import prepare_array
    from schuler.navigation.mechanizations.array_stream import ArrayFilter
    from schuler.navigation.settings import NavigationSettings
    from schuler.simulation import car_urban, simulate_array, simulate_gnss

    rng = np.random.default_rng(3)
    profile = car_urban(90.0, rng, standstill=20.0)
    mounting = Mounting.aligned(2)
    places = (mounting.rotation, mounting.position)
    recordings = simulate_array(profile, *places, example_noise(), EXAMPLE_RATE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    array = ImuArray.from_recordings(recordings, mounting)
    settings = NavigationSettings(time_offset=0.0)
    compare_mechanizations(array, gnss, example_noise(), settings)
    live = ArrayFilter(prepare_array(array, gnss, example_noise(), settings), gnss)
    for k in range(40):
        gyro = array.gyro[k].copy()
        gyro[0] = np.nan if k == 20 else gyro[0]
        live.add_array(array.time[k], gyro, array.accel[k])


def _synthetic() -> None:
    import numpy as np

    from schuler.arrays.detection.fault_settings import FaultSettings
    from schuler.arrays.synthesis.synthetic import synthesize
    from schuler.data import ImuArray, Mounting

    rng = np.random.default_rng(3)
    noise = 1e-3 * rng.standard_normal((2, 2000, 4, 3))
    array = ImuArray(np.arange(2000) / 100.0, noise[0], noise[1], Mounting.aligned(4))
    synthesize(array, faults=FaultSettings())


REHEARSALS: tuple[Callable[[], None], ...] = (
    _characterize,
    _methods,
    _navigate,
    _outages,
    _arrays,
    _mechanizations,
    _synthetic,
)
"""Each calls a part of the kernels."""
