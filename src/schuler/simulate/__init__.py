"""Twins of real recordings: known motion, and what IMU and GNSS would have recorded on it."""

from schuler.simulate.cars import car_mixed, car_urban
from schuler.simulate.drives import Balance, Manoeuvre, Road, Suspension, drive
from schuler.simulate.flying import drone
from schuler.simulate.gnss import antenna_motion, simulate_gnss
from schuler.simulate.imu import TriadErrors, ideal_imu, simulate_imu, simulate_static
from schuler.simulate.profile import Motion, Profile, fit_profile, from_waypoints, static
from schuler.simulate.riding import motorcycle
from schuler.simulate.skiing import ski
from schuler.simulate.tracks import from_track
from schuler.simulate.walking import Gait, walk

__all__ = [
    "Balance",
    "Gait",
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
    "drone",
    "fit_profile",
    "from_track",
    "from_waypoints",
    "ideal_imu",
    "motorcycle",
    "simulate_gnss",
    "simulate_imu",
    "simulate_static",
    "ski",
    "static",
    "walk",
]
