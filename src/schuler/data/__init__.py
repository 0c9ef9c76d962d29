"""What was measured and what was solved: frozen records of float64 arrays."""

from schuler.data.array import ImuArray
from schuler.data.gnss import GnssRecording
from schuler.data.imu import CHANNELS, ImuRecording
from schuler.data.mounting import Mounting
from schuler.data.trajectory import Innovations, NavigationSolution, Trajectory

__all__ = [
    "CHANNELS",
    "GnssRecording",
    "ImuArray",
    "ImuRecording",
    "Innovations",
    "Mounting",
    "NavigationSolution",
    "Trajectory",
]
