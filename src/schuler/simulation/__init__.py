"""Twins of real recordings: known motion, and what IMU and GNSS would have recorded on it."""

from schuler.simulation.array import simulate_array
from schuler.simulation.effects import ManoeuvreNoise, TemperatureDrift, warm_up
from schuler.simulation.faults import (
    DropOut,
    Fault,
    FaultEntry,
    NoiseBurst,
    RampFault,
    SampleSlip,
    StepFault,
    StuckFault,
    TimeJump,
    inject_faults,
)
from schuler.simulation.gnss import antenna_motion, simulate_gnss
from schuler.simulation.imu import TriadErrors, ideal_imu, simulate_imu, simulate_static
from schuler.simulation.motions.cars import car_mixed, car_urban
from schuler.simulation.motions.drives import Balance, Manoeuvre, Road, Suspension, drive
from schuler.simulation.motions.flying import drone
from schuler.simulation.motions.profile import Motion, Profile, fit_profile, from_waypoints, static
from schuler.simulation.motions.riding import motorcycle
from schuler.simulation.motions.skiing import ski
from schuler.simulation.motions.tracks import from_track
from schuler.simulation.motions.walking import Gait, walk
from schuler.simulation.receivers import (
    DIFFERENTIAL_CODE,
    L1_CODE,
    RTK_FIXED,
    GnssGrade,
    simulate_receiver,
)
from schuler.simulation.reference import tactical_grade_noise
from schuler.simulation.size_effect import add_size_effect, arm_tensor
from schuler.simulation.stamps import StampErrors, box_car, box_car_gain, restamp
from schuler.simulation.vibration import (
    Vibration,
    add_vibration,
    engine_turning_rate,
    wheel_turning_rate,
)

__all__ = [
    "DIFFERENTIAL_CODE",
    "L1_CODE",
    "RTK_FIXED",
    "Balance",
    "DropOut",
    "Fault",
    "FaultEntry",
    "Gait",
    "GnssGrade",
    "Manoeuvre",
    "ManoeuvreNoise",
    "Motion",
    "NoiseBurst",
    "Profile",
    "RampFault",
    "Road",
    "SampleSlip",
    "StampErrors",
    "StepFault",
    "StuckFault",
    "Suspension",
    "TemperatureDrift",
    "TimeJump",
    "TriadErrors",
    "Vibration",
    "add_size_effect",
    "add_vibration",
    "antenna_motion",
    "arm_tensor",
    "box_car",
    "box_car_gain",
    "car_mixed",
    "car_urban",
    "drive",
    "drone",
    "engine_turning_rate",
    "fit_profile",
    "from_track",
    "from_waypoints",
    "ideal_imu",
    "inject_faults",
    "motorcycle",
    "restamp",
    "simulate_array",
    "simulate_gnss",
    "simulate_imu",
    "simulate_receiver",
    "simulate_static",
    "ski",
    "static",
    "tactical_grade_noise",
    "walk",
    "warm_up",
    "wheel_turning_rate",
]
