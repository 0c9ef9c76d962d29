"""Lines of wheels in vibration: found, not mistaken for an engine's, and read as a speed."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.navigation.aiding.wheel_lines import VibrationBlock, WheelMemory, vibration_block
from schuler.simulation import Vibration, add_vibration, engine_turning_rate, wheel_turning_rate

RATE = 100.0
CIRCUMFERENCE = 1.95
BLOCK = 400
# a line of this rms in white noise of 0.1 m/s² stands some times above it in a block of 4 s
WHEEL = tuple(
    Vibration(accel=np.full(3, 0.02), gyro=np.full(3, 0.002), order=k, bandwidth=0.05)
    for k in (1.0, 2.0, 3.0, 4.0)
)
ENGINE = tuple(
    Vibration(accel=np.full(3, 0.05), gyro=np.full(3, 0.005), order=k) for k in (0.5, 1.0, 1.5, 2.0)
)


def speeds(seed: int, seconds: float = 240.0) -> np.ndarray:
    """Between 7 and 16 m/s, changing by less than 1 m/s²."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    return 11.5 + 3.0 * np.sin(0.1 * time + phase[0]) + 1.5 * np.sin(0.23 * time + phase[1])


def shaken(turns: np.ndarray, lines: tuple[Vibration, ...], seed: int) -> np.ndarray:
    """Six channels of white noise and of what turns."""
    rng = np.random.default_rng([seed, 1])
    n = turns.size
    noise = rng.standard_normal((n, 6)) * np.repeat([0.1, 0.01], 3)
    still = ImuRecording(np.arange(n) / RATE, noise[:, 3:], noise[:, :3])
    imu = add_vibration(still, lines, rng, turning_rate=turns)
    return np.concatenate([imu.accel, imu.gyro], axis=1)


def blocks(speed: np.ndarray, channels: np.ndarray) -> list[VibrationBlock]:
    time = np.arange(speed.size) / RATE
    cuts = [slice(i, i + BLOCK) for i in range(0, speed.size - BLOCK + 1, BLOCK // 2)]
    return [vibration_block(time[c], channels[c], speed[c]) for c in cuts]


@pytest.fixture(scope="module")
def memory() -> WheelMemory:
    speed = speeds(1)
    found = WheelMemory()
    for block in blocks(speed, shaken(wheel_turning_rate(speed, CIRCUMFERENCE), WHEEL, 1)):
        found.learn(block)
    return found


def test_the_circumference_is_found(memory: WheelMemory) -> None:
    assert memory.order is not None
    # a block of 46 m resolves 0.022 cycles/m, its fourth harmonic a quarter of that; over a
    # hundred blocks: 0.1 %, which is also the grid
    assert memory.order * CIRCUMFERENCE == pytest.approx(1.0, abs=2.5e-3)
    strength = memory.strengths(11.0)
    assert strength.shape == (6, 6)
    # mean power 0.02² 400 0.81 / 0.1² = 13 if it were a sinusoid; here it is as wide as a block
    # resolves, fluctuates, and is cut off by the largest ratio
    assert 2.0 < strength[:, :4].mean() < 8.0
    assert strength[:, 4:].mean() < 0.3


def test_an_error_of_speed_is_read_off_the_lines(memory: WheelMemory) -> None:
    speed = speeds(2)
    channels = shaken(wheel_turning_rate(speed, CIRCUMFERENCE), WHEEL, 2)
    time = np.arange(speed.size) / RATE
    shifts, accelerations = np.linspace(-2.0, 2.0, 401), np.linspace(-0.3, 0.3, 11)
    wrong = []
    for start in range(0, speed.size - BLOCK, BLOCK):
        c = slice(start, start + BLOCK)
        since = time[c] - time[c][-1]
        # true minus assumed: 0.7 m/s at the end, changing by -0.12 m/s²
        block = vibration_block(time[c], channels[c], speed[c] - 0.7 + 0.12 * since)
        value = memory.log_likelihood(block, shifts, accelerations)
        a, s = np.unravel_index(np.argmax(value), value.shape)
        wrong.append((shifts[s] - 0.7, accelerations[a] + 0.12))
    errors = np.array(wrong)
    # 4 s resolve 0.25 Hz or 0.12 m/s at the fourth harmonic in the middle of the block, where
    # speed and acceleration do not mix, and an acceleration of 0.06 m/s²
    middle = np.abs(errors[:, 0] - 2.0 * errors[:, 1])
    assert np.mean(middle < 0.12) > 0.9
    assert np.median(middle) < 0.05
    assert np.median(np.abs(errors[:, 1])) <= 0.06 + 1e-9


@pytest.mark.parametrize(
    "metres_per_turn", [(0.14, 0.26, 0.40, 0.55, 0.70), (0.55,)], ids=["gears", "one gear"]
)
def test_an_engine_is_no_wheel(metres_per_turn: tuple[float, ...]) -> None:
    speed = speeds(3)
    found = WheelMemory()
    turns = engine_turning_rate(speed, metres_per_turn=metres_per_turn)
    for block in blocks(speed, shaken(turns, ENGINE, 3)):
        found.learn(block)
    assert found.order is None


def test_noise_is_no_wheel_and_lines_are_found_beside_an_engine() -> None:
    speed = speeds(4)
    quiet, both = WheelMemory(), WheelMemory()
    noise = shaken(np.ones(speed.size), (), 4)
    engine = shaken(engine_turning_rate(speed), ENGINE, 5)
    wheel = shaken(wheel_turning_rate(speed, CIRCUMFERENCE), WHEEL, 6)
    for block in blocks(speed, noise):
        quiet.learn(block)
    for block in blocks(speed, engine + wheel):
        both.learn(block)
    assert quiet.order is None
    assert both.order is not None
    assert both.order * CIRCUMFERENCE == pytest.approx(1.0, abs=5e-3)
