"""What of two recordings can be navigated with."""

from __future__ import annotations

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.gnss import require_overlap, require_possible
from schuler.navigation.preparation.rest import find_initial_rest


def check_inputs(imu: ImuRecording, gnss: GnssRecording) -> None:
    """Refuse what cannot be navigated with."""
    if not imu.complete:
        raise InputError(
            f"recording '{imu.name}' has only {', '.join(imu.channels)}",
            expected="three gyros and three accelerometers",
        )
    for name in imu.channels:
        if not np.any(imu.channel(name)):
            raise InputError(
                f"{name} of '{imu.name}' is zero throughout",
                expected="a sensor that is connected",
                cure="check the columns of the file",
            )
    require_possible(gnss)
    require_overlap(gnss, float(imu.time[0]), float(imu.time[-1]))


def from_first_fix(imu: ImuRecording, gnss: GnssRecording) -> ImuRecording:
    """Cut what comes before GNSS, unless it is rest, which tells level and biases."""
    if imu.time[0] >= gnss.time[0] - 2.0:
        return imu
    rest = find_initial_rest(imu, gnss)
    if rest is not None and rest[1] >= gnss.time[0] - 2.0:
        return imu
    cut = imu.between(float(gnss.time[0]) - 1.0, np.inf)
    if cut.size < 100:
        raise NavigationError(
            f"only {cut.size} IMU samples after the first GNSS fix", expected="at least 100"
        )
    return cut
