"""Trajectories as receivers and GNSS/INS programs write them: .pos, .nav, SBET, NMEA."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from schuler.io.format import Format, TrackColumns
from schuler.io.trajectories.frames import (
    attitude,
    gps_week_and_seconds,
    place,
    thinned,
    utc,
    velocity,
)

_POS_HEAD = (
    "% program   : schuler\n"
    "%  GPST        latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  "
    "sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)   sdvn   sdve   "
    "sdvu  sdvne  sdveu  sdvun\n"
)
_LOOKED_AT = 5.0  # rows a second of NMEA


def write_pos(path: Path, track: TrackColumns) -> None:
    """Write a solution of RTKLIB, with velocities."""
    week, seconds = gps_week_and_seconds(track["time_s"])
    zero = np.zeros(week.size)
    axes = ("north", "east", "down")
    sd = [track.get(f"pos_std_{a}_m", zero) for a in axes]
    sdv = [track.get(f"vel_std_{a}_m_s", zero) for a in axes]
    speed = velocity(track)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(_POS_HEAD)
        for k in range(week.size):
            stream.write(
                f"{week[k]:4.0f} {seconds[k]:.6f} {track['latitude_deg'][k]:.9f} "
                f"{track['longitude_deg'][k]:.9f} {track['height_m'][k]:.4f} 1 0 "
                f"{sd[0][k]:.4f} {sd[1][k]:.4f} {sd[2][k]:.4f} 0.0000 0.0000 0.0000 0.00 0.0 "
                f"{speed[k, 0]:.5f} {speed[k, 1]:.5f} {-speed[k, 2]:.5f} "
                f"{sdv[0][k]:.5f} {sdv[1][k]:.5f} {sdv[2][k]:.5f} 0.0 0.0 0.0\n"
            )


def write_nav(path: Path, track: TrackColumns) -> None:
    """Write the result of KF-GINS: week, seconds, position, velocity, attitude in degrees."""
    week, seconds = gps_week_and_seconds(track["time_s"])
    speed, angles = velocity(track), np.degrees(attitude(track))
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        for k in range(week.size):
            stream.write(
                f"{week[k]:.0f} {seconds[k]:.9f} {track['latitude_deg'][k]:.12f} "
                f"{track['longitude_deg'][k]:.12f} {track['height_m'][k]:.6f} "
                + " ".join(f"{x:.9f}" for x in (*speed[k], *angles[k]))
                + "\n"
            )


def write_sbet(path: Path, track: TrackColumns) -> None:
    """Write SBET; velocity is north, east, down, as the wander angle is 0."""
    _, seconds = gps_week_and_seconds(track["time_s"])
    table = np.zeros((seconds.size, 17))
    table[:, 0] = seconds
    table[:, 1:4] = place(track)
    table[:, 4:7] = velocity(track)
    table[:, 7:10] = attitude(track)
    path.write_bytes(table.astype("<f8").tobytes())


def _sentence(body: str) -> str:
    total = int(np.bitwise_xor.reduce(np.frombuffer(body.encode(), np.uint8)))
    return f"${body}*{total:02X}\r\n"


def _ddmm(degrees: float, width: int, sides: str) -> str:
    minutes = round(abs(degrees) * 60.0, 7)
    whole = int(minutes // 60)
    side = sides[0] if degrees >= 0.0 else sides[1]
    return f"{whole:0{width}d}{minutes - 60 * whole:010.7f},{side}"


def _sentences(track: TrackColumns) -> Iterator[str]:
    speed = velocity(track)
    axes = ("north", "east", "down")
    sd = [track.get(f"pos_std_{a}_m") for a in axes]
    for k, stamp in enumerate(utc(track["time_s"])):
        # Sentences give hundredths of a second; the moment is rounded before it is written.
        moment = datetime.datetime.fromtimestamp(0, datetime.UTC) + datetime.timedelta(
            milliseconds=round(stamp * 1e3)
        )
        clock = moment.strftime("%H%M%S.") + f"{moment.microsecond // 1000:03d}"
        at = (_ddmm(track["latitude_deg"][k], 2, "NS") + ","
              + _ddmm(track["longitude_deg"][k], 3, "EW"))  # fmt: skip
        knots = np.hypot(*speed[k, :2]) * 3600.0 / 1852.0
        course = np.degrees(np.arctan2(speed[k, 1], speed[k, 0])) % 360.0
        yield _sentence(f"GPGGA,{clock},{at},1,12,1.0,{track['height_m'][k]:.3f},M,0.0,M,,")
        yield _sentence(f"GPRMC,{clock},A,{at},{knots:.4f},{course:.3f},{moment:%d%m%y},,,A")
        if all(s is not None for s in sd):
            values = ",".join(f"{s[k]:.4f}" for s in sd if s is not None)
            yield _sentence(f"GPGST,{clock},,,,,{values}")


def write_nmea(path: Path, track: TrackColumns) -> None:
    """Write GGA, RMC and GST, at most five times a second; heights above the ellipsoid."""
    with path.open("w", encoding="ascii", newline="") as stream:
        stream.writelines(_sentences(thinned(track, _LOOKED_AT)))


FORMATS = (Format("kf-gins-nav", "the result of KF-GINS", (".nav",), write_trajectory=write_nav),)
