"""Which column is what: names of columns and their units, as the makers of files write them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from schuler import units
from schuler.errors import InputError

# A role is what a column means to us. Each has patterns for its bare name: lower case, without
# unit, without anything but letters and digits.
_GYRO = (
    r"(?:gyro|gyr|gyros|gyroscope|angularvelocity|angularrate|angvel|rotationrate|omega|wrss|w|g)"
)
_ACCEL = (
    r"(?:accel|acc|accelerometer|linearacceleration|linacc|specificforce|sf|force|acceleration|arss"
    r"|f|a)"
)
_ANGLE_STEP = r"(?:dtheta|dth|deltatheta|deltaangle|delang|angleincrement|anginc|dang|thetainc)"
_VELOCITY_STEP = r"(?:dv|dvel|deltavelocity|deltav|delvel|velocityincrement|velinc|vinc)"


def _axes(role: str, stem: str) -> dict[str, str]:
    return {
        f"{role}_{axis}": rf"(?:{stem}{axis}|{axis}{stem}|{stem}{k})"
        for k, axis in enumerate("xyz", start=1)
    }


_TIMES = (
    "time",
    "times",
    "timestamp",
    "stamp",
    "t",
    "headerstamp",
    "unixtime",
    "utcunix",
    "elapsed",
    "elapsedtime",
    "seconds",
    "epoch",
    "datetime",
    "utc",
    "utctime",
    "gpst",
    "timeutc",
    "timegps",
    "gpstime",
    "itow",
    "gpstow",
    "tow",
    "sow",
    "gpssow",
    "secondsofweek",
    "gpsseconds",
    "gpssecond",
    "timeofweek",
)
IMU_ROLES: dict[str, str] = {
    "date": r"(?:utc)?date|dateutc",
    "week": r"(?:gps)?(?:week|wn|weeknumber)",
    **_axes("gyro", _GYRO),
    **_axes("accel", _ACCEL),
    **_axes("angle_step", _ANGLE_STEP),
    **_axes("velocity_step", _VELOCITY_STEP),
    "temperature": r"(?:imu)?temp(?:erature)?",
    "imu": r"(?:imu|imuid|imunumber|sensor|sensorid)",
}
_POSITION_SD = r"(?:posstd|possd|possigma|positionstd|positionsd|stdpos|sdpos|posacc)"
_VELOCITY_SD = r"(?:velstd|velsd|velsigma|velocitystd|velocitysd|stdvel|sdvel|velacc)"
GNSS_ROLES: dict[str, str] = {
    "date": IMU_ROLES["date"],
    "week": IMU_ROLES["week"],
    "latitude": r"(?:gnss|gps|navsatfix)?(?:lat|latitude)",
    "longitude": r"(?:gnss|gps|navsatfix)?(?:lon|lng|long|longitude)",
    "height": r"(?:gnss|gps)?(?:height|alt|altitude|h|hgt|heightmsl|altitudemsl|hmsl|"
    r"ellipsoidalheight|heightellipsoid)",
    "north": r"(?:pos|position|local)?(?:north|n)",
    "east": r"(?:pos|position|local)?(?:east|e)",
    "down": r"(?:pos|position|local)?(?:down|d)",
    "up": r"(?:pos|position|local)?(?:up|u)",
    "ecef_x": r"(?:xecef|ecefx)",
    "ecef_y": r"(?:yecef|ecefy)",
    "ecef_z": r"(?:zecef|ecefz)",
    "velocity_north": r"(?:vel|velocity|v)(?:north|n)|northvelocity",
    "velocity_east": r"(?:vel|velocity|v)(?:east|e)|eastvelocity",
    "velocity_down": r"(?:vel|velocity|v)(?:down|d)|downvelocity",
    "velocity_up": r"(?:vel|velocity|v)(?:up|u)|upvelocity",
    "speed": r"(?:gnss|gps|ground|horizontal)?speed|speedoverground|sog",
    "course": r"bearing|course|courseoverground|cog|track|headingofmotion|headmot",
    "position_sd": _POSITION_SD,
    "position_sd_north": rf"{_POSITION_SD}(?:north|n)|sdn|stdn|northsd|northstd",
    "position_sd_east": rf"{_POSITION_SD}(?:east|e)|sde|stde|eastsd|eaststd",
    "position_sd_down": rf"{_POSITION_SD}(?:down|d|up|u)|sdu|sdd|stdu|stdd|"
    r"upsd|downsd|upstd|downstd",
    "horizontal_accuracy": r"hacc|horizontalaccuracy|hdev|accuracy",
    "vertical_accuracy": r"vacc|verticalaccuracy|vdev",
    "velocity_sd": rf"{_VELOCITY_SD}|sacc|speedaccuracy",
    "velocity_sd_north": rf"{_VELOCITY_SD}(?:north|n)|sdvn",
    "velocity_sd_east": rf"{_VELOCITY_SD}(?:east|e)|sdve",
    "velocity_sd_down": rf"{_VELOCITY_SD}(?:down|d|up|u)|sdvu|sdvd",
    "quality": r"q|quality|fixquality|fixtype|fix",
}
_BRACKET = re.compile(r"^(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\])]*(?:\([^)]*\))?[^\])]*)[\])]\s*$")
_NUMBERED = re.compile(r"^(?P<name>.*)\[(?P<axis>[012])\]$")
_INDEXED = re.compile(r"^(?:imu|sensor)_?(?P<imu>\d+)[_. ]?(?P<rest>.*)$", re.I)
_MEASURES = ("angular rate", "acceleration", "angle", "velocity", "length", "time")


@dataclass(frozen=True, slots=True)
class Column:
    """A column whose meaning was found.

    Parameters
    ----------
    role : str
        What it is, e.g. "gyro_x".
    name : str
        Its name in the file.
    unit : str
        Its unit as written; empty when the file does not say.
    """

    role: str
    name: str
    unit: str


def split_unit(name: str) -> tuple[str, str]:
    """Split the name of a column into the bare name and the unit."""
    match = _NUMBERED.match(name)
    if match:
        stem, unit = split_unit(match["name"])
        # PX4 writes gyro_rad[0] for an angular rate in rad/s.
        return f"{stem}_{'xyz'[int(match['axis'])]}", "rad/s" if unit == "rad" else unit
    match = _BRACKET.match(name)
    if match and (_is_unit(match["unit"]) or not match["unit"]):
        return match["name"].strip(), match["unit"].strip()
    parts = name.split("_")
    for count in (3, 2, 1):
        tail = "_".join(parts[-count:])
        if len(parts) > count and _is_unit(tail) and not _part_of_name(parts, count):
            return "_".join(parts[:-count]), tail
    return name, ""


def bare(name: str) -> str:
    """Return a name in lower case, letters and digits only."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _is_unit(text: str) -> bool:
    if text.lower() in {"degc", "c", "°c", "celsius", "k"}:
        return True
    return any(units.measures(text, kind) for kind in _MEASURES)


def _part_of_name(parts: Sequence[str], count: int) -> bool:
    """Tell whether the tail is the name itself, as the 'g' of 'acc_g' is not but 'h' alone is."""
    return not any(bare(p) for p in parts[:-count])


def find_columns(
    names: Sequence[str], roles: Mapping[str, str], stated_units: Mapping[str, str]
) -> dict[str, Column]:
    """Find the columns that play a role."""
    found: dict[str, Column] = {}
    ranks: dict[str, int] = {}
    for name in names:
        stem, unit = split_unit(name)
        unit = stated_units.get(name, unit)
        text = bare(stem)
        if text in _TIMES:
            rank = _TIMES.index(text)
            if "time" not in found or rank < ranks["time"]:
                found["time"], ranks["time"] = Column("time", name, unit), rank
            continue
        for role, pattern in roles.items():
            if role not in found and re.fullmatch(pattern, _short(text)):
                found[role] = Column(role, name, unit)
                break
    return found


def _short(text: str) -> str:
    """Drop words that makers put before or behind the sensor: 'imugyrox', 'gyroxraw'."""
    text = re.sub(r"^(?:field|imu|sensor|body|raw)+(?=(?:gyr|acc|ang|lin|omega))", "", text)
    return re.sub(r"(?<=[xyz])(?:raw|uncal|calibrated|cal)$", "", text)


def imu_numbers(names: Iterable[str]) -> tuple[int, ...]:
    """Return the numbers of the IMUs that stand side by side as ``imuK_gyro_x`` and so on."""
    found = {int(m["imu"]) for m in map(_INDEXED.match, names) if m and m["rest"]}
    return tuple(sorted(found))


def names_of_imu(names: Sequence[str], imu: int) -> dict[str, str]:
    """Return the names that belong to one of several IMUs side by side."""
    result = {}
    for name in names:
        match = _INDEXED.match(name)
        if match is None or not match["rest"]:
            result[name] = name
        elif int(match["imu"]) == imu:
            result[match["rest"]] = name
    return result


def missing(wanted: str, names: Sequence[str], where: str, option: str = "columns") -> InputError:
    """Return the error for a column that cannot be found."""
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return InputError(
        f"no column for {wanted} among: {shown}",
        expected="names such as time_s, gyro_x_rad_s, accel_x_m_s2, latitude_deg",
        cure=f"say which column is which with {option}=",
        where=where,
    )
