"""Time of one call in a real-time loop, and that the stream ends where the batch filter does.

A drive of 100 Hz with GNSS once a second that arrives 0.2 s late, fed sample by sample from Python:
`add_imu` and `add_gnss`, each timed by itself, in CPU time of this thread; then `add_array` of four
IMUs, faults looked for. What else the machine does still empties the caches in between, so every
figure is the least of three streams.
`python -m benchmarks.streaming`, or with `--against PATH` the ratio to another checkout, in turn.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.against import least_in_turn
from benchmarks.array_faults import draw, noise_model
from benchmarks.filter_speed import LEVER, recordings, sensor_model, started
from schuler.data import ImuRecording
from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.mechanizations.array_preparation import prepare_array
from schuler.navigation.mechanizations.array_stream import ArrayFilter
from schuler.navigation.settings import NavigationSettings
from schuler.navigation.stream.navigation_filter import NavigationFilter
from schuler.navigation.stream.state import GnssReceiver

Array = NDArray[np.float64]

LATE = 0.2
WARM_UP = 500
STREAMS = 3
MOST_IMU = 20.0
MOST_GNSS = 200.0
MOST_ARRAY = 15.0
# in turn with another checkout
ROUNDS = 12
COMPARED = (15, 33)
CODE = """
import numpy as np
import benchmarks.filter_speed as f
import benchmarks.streaming as b
f.DURATION = 120.0
imu, schedule, start = f.recordings()

def answer(states):
    by_imu, by_gnss, _ = b.stream(imu, schedule, start, states, None)
    return [float(v) for times in (by_imu, by_gnss) for v in np.percentile(times, [50, 99])]
"""


def stream(
    imu: ImuRecording,
    schedule: AidingSchedule,
    start: InitialState,
    states: int,
    lag: float | None,
) -> tuple[Array, Array, NavigationFilter]:
    """Microseconds of every add_imu and add_gnss, and the filter at the end."""
    model = sensor_model(states)
    filter_ = NavigationFilter(
        started(start, model),
        model,
        gate=gate_thresholds(0.0),
        rate=100.0,
        late=1.0,
        lag=lag,
        receiver=GnssReceiver(LEVER),
    )
    # position and velocity of one epoch are neighbours in the schedule
    epochs = schedule.time[::2]
    sd = np.sqrt(schedule.variance)
    waiting = 0
    by_imu, by_gnss = [], []
    clock = time.thread_time_ns
    times = imu.time.tolist()
    gc.disable()
    for k, now in enumerate(times):
        gyro, accel = imu.gyro[k], imu.accel[k]
        begin = clock()
        filter_.add_imu(now, gyro, accel)
        by_imu.append(clock() - begin)
        while waiting < epochs.size and epochs[waiting] + LATE <= now:
            p, v = 2 * waiting, 2 * waiting + 1
            begin = clock()
            filter_.add_gnss(epochs[waiting], schedule.value[p], sd[p], schedule.value[v], sd[v])
            by_gnss.append(clock() - begin)
            waiting += 1
    gc.enable()
    skip = WARM_UP // 100
    return np.array(by_imu[WARM_UP:]) / 1e3, np.array(by_gnss[skip:]) / 1e3, filter_


def array_stream() -> Array:
    """Microseconds of every add_array of four IMUs, tests of faults and parity among them."""
    noise = noise_model()
    array, gnss, _ = draw(300, noise)
    told = NavigationSettings(time_offset=0.0, tune_noise=False)
    begin = float(array.time[0])
    live = ArrayFilter(prepare_array(array.between(begin, begin + 40.0), gnss, noise, told), gnss)
    taken, clock = [], time.thread_time_ns
    gc.disable()
    for k, now in enumerate(array.time[:8000].tolist()):
        gyro, accel = array.gyro[k], array.accel[k]
        start = clock()
        live.add_array(now, gyro, accel)
        taken.append(clock() - start)
    gc.enable()
    if live.absences:
        raise SystemExit(f"a healthy sensor was taken out: {live.absences[0].text}")
    return np.array(taken[WARM_UP:]) / 1e3


def compare(other: Path) -> int:
    """Print medians and 99th percentiles here, and their ratio to those of another checkout."""
    print("microseconds of CPU a call, and over those of the other checkout")
    names = ("add_imu median", "p99", "add_gnss median", "p99")
    found = least_in_turn(other, CODE, COMPARED, ROUNDS)
    for states, (ours, theirs) in zip(COMPARED, found, strict=True):
        words = zip(names, ours, theirs, strict=True)
        text = ", ".join(f"{word} {cost:.1f} ({cost / base:.2f})" for word, cost, base in words)
        print(f"{states} states: {text}", flush=True)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout, e.g. of a release")
    other = parser.parse_args().against
    return compare(other.resolve()) if other else judge()


def judge() -> int:
    """Print what a call costs, and whether that is little enough."""
    imu, schedule, start = recordings()
    checks = []
    print("microseconds of CPU a call: median, 99th percentile, largest")
    for states, lag in ((15, None), (15, 2.0), (33, None)):
        runs = [stream(imu, schedule, start, states, lag) for _ in range(STREAMS)]
        filter_ = runs[-1][2]
        for place, name, most in ((0, "add_imu", MOST_IMU), (1, "add_gnss", MOST_GNSS)):
            spread = [np.percentile(r[place], [50, 99, 100]) for r in runs]
            middle, high, largest = np.min(spread, axis=0)
            with_lag = "" if lag is None else f", lag {lag:g} s"
            print(f"{states} states{with_lag}: {name:8s} {middle:7.1f} {high:7.1f} {largest:8.1f}")
            text = f"{states} states{with_lag}: {name} {high:.1f} (at most {most:g})"
            checks.append((bool(high <= most), text))
        model = sensor_model(states)
        used = schedule.time + LATE <= imu.time[-1]
        short = AidingSchedule(
            schedule.time[used],
            schedule.kind[used],
            schedule.value[used],
            schedule.variance[used],
            schedule.lever_arm[used],
        )
        done = run_engine(
            imu, started(start, model), model, short, gate=gate_thresholds(0.0), keep_nodes=False
        )
        same = np.array_equal(filter_.state().position, done.samples.position[-1])
        checks.append((same, f"{states} states: the batch filter ends at the same bits"))
    found = [np.percentile(array_stream(), [50, 99, 100]) for _ in range(STREAMS)]
    middle, high, largest = np.min(found, axis=0)
    print(f"four IMUs: add_array {middle:7.1f} {high:7.1f} {largest:8.1f}")
    checks.append((bool(high <= MOST_ARRAY), f"add_array {high:.1f} (at most {MOST_ARRAY:g})"))
    for good, text in checks:
        print(("reached: " if good else "MISSED: ") + text)
    return 0 if all(good for good, _ in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
