"""Twins of real recordings: known motion, and what IMU and GNSS would have recorded on it."""

from schuler.simulate.cars import car_mixed, car_urban
from schuler.simulate.drives import Manoeuvre, Road, Suspension, drive
from schuler.simulate.gnss import antenna_motion, simulate_gnss
from schuler.simulate.imu import TriadErrors, ideal_imu, simulate_imu, simulate_static
from schuler.simulate.profile import Motion, Profile, fit_profile, from_waypoints, static

__all__ = [
    "Manoeuvre",
    "Motion",
    "Profile",
    "Road",
    "Suspension",
    "TriadErrors",
    "antenna_motion",
    "car_mixed",
    "car_urban",
    "drive",
    "fit_profile",
    "from_waypoints",
    "ideal_imu",
    "simulate_gnss",
    "simulate_imu",
    "simulate_static",
    "static",
]
