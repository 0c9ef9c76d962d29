"""Which column is what: names of columns and their units, as the makers of files write them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from schuler import units
from schuler.errors import InputError

# A role is what a column means to us. Each has patterns for its bare name: lower case, without
# unit, without anything but letters and digits.
_LONG_GYRO = (
    r"(?:gyro|gyr|gyros|gyroscope|angularvelocity|angularrate|angvel|rotationrate|omega|wrss"
    r"|gyrorotation|turnrate|gyroadc)"
)
_LONG_ACCEL = (
    r"(?:accel|acc|accl|accelerometer|linearacceleration|linacc|specificforce|force|acceleration"
    r"|arss|accelerometeracceleration|gforce|accsmooth)"
)
_GYRO = rf"(?:{_LONG_GYRO}|w|g|gy)"
_ACCEL = rf"(?:{_LONG_ACCEL}|sf|f|a|ac|gf)"
_ANGLE_STEP = r"(?:dtheta|dth|deltatheta|deltaangle|delang|angleincrement|anginc|dang|thetainc)"
_VELOCITY_STEP = r"(?:dv|dvel|deltavelocity|deltav|delvel|velocityincrement|velinc|vinc)"


def _axes(role: str, stem: str) -> dict[str, str]:
    return {
        f"{role}_{axis}": rf"(?:{stem}{axis}|{axis}{stem}|{stem}{k})"
        for k, axis in enumerate("xyz", start=1)
    }


_TIMES = (
    "headerstamp",
    "fieldheaderstamp",
    "timestampsample",
    "time",
    "times",
    "timestamp",
    "stamp",
    "t",
    "ts",
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
    "sampletimefine",
    "gnssseconds",
    "systemtime",
    "loggingtime",
    "loggingtimetxt",
    "timesincestart",
    "secondselapsed",
)
_TICKS = re.compile(
    r"(?:unix|utc|gps|sensor|elapsedrealtime|sample|event|epoch|system|boot|time|timestamp|t)*"
    r"(?P<unit>nanos|nanoseconds|nanosecond|nsec|ns|micros|microseconds|microsecond|usec|us|millis"
    r"|milliseconds|millisecond|msec|ms)(?:sincestart|sinceboot|elapsed)?"
    r"|time(?:sincestart|sinceboot|elapsed)in(?P<behind>ms|us|ns)"
)
_TICK_UNITS = {"n": "ns", "mic": "us", "u": "us", "mil": "ms", "ms": "ms"}
_LATE_TIME = re.compile(r".*time(?:stamp)?(?:unix|sync|sys|utc|gps)?(?:cal|raw)?")
COUNTERS = re.compile(
    r"(?:packet|sample|frame|msg|message|imu|seq|line|row)*"
    r"(?:counter|count|number|seq|sequence|index|id|cnt|num|nr)"
)
"""Bare names of columns that count samples."""
_WHOLE = r"(?:secs?|seconds|s)"
_PART = r"(?:nsecs?|nanosecs?|nanoseconds?|nanos?|ns)"
IMU_ROLES: dict[str, str] = {
    "date": r"(?:utc)?date|dateutc",
    "week": r"(?:gps)?(?:week|wn|weeknumber)",
    **{
        role: rf"{pattern}|{named}"
        for (role, pattern), named in zip(
            _axes("gyro", _GYRO).items(),
            ("rollrate|ratex|p", "pitchrate|ratey|q", "yawrate|ratez|r"),
            strict=True,
        )
    },
    **_axes("accel", _ACCEL),
    **_axes("angle_step", _ANGLE_STEP),
    **_axes("velocity_step", _VELOCITY_STEP),
    "temperature": r"(?:imu)?temp(?:erature)?",
    "imu": r"(?:imu|imuid|imunumber|sensor|sensorid|i|instance|imuinstance)",
}
_POSITION_SD = r"(?:posstd|possd|possigma|positionstd|positionsd|stdpos|sdpos|posacc)"
_VELOCITY_SD = r"(?:velstd|velsd|velsigma|velocitystd|velocitysd|stdvel|sdvel|velacc)"
GNSS_ROLES: dict[str, str] = {
    "date": IMU_ROLES["date"],
    "week": IMU_ROLES["week"],
    "latitude": r"(?:gnss|gps|navsatfix|location)?(?:lat|latitude)(?:degrees)?",
    "longitude": r"(?:gnss|gps|navsatfix|location)?(?:lon|lng|long|longitude)(?:degrees)?",
    "height": r"(?:gnss|gps|location|navsatfix)?(?:ellipsoidalheight|heightellipsoid|altellipsoid|"
    r"hell|ellh|height|alt|altitude|h|hgt|heightmsl|altitudemsl|hmsl|amsl)",
    "north": r"(?:pos|position|local)?(?:north|n)|nbaseline",
    "east": r"(?:pos|position|local)?(?:east|e)|ebaseline",
    "down": r"(?:pos|position|local)?(?:down|d)",
    "up": r"(?:pos|position|local)?(?:up|u)|ubaseline",
    "ecef_x": r"(?:xecef|ecefx)",
    "ecef_y": r"(?:yecef|ecefy)",
    "ecef_z": r"(?:zecef|ecefz)",
    "velocity_north": r"(?:vel|velocity|v)(?:north|n)|(?:north|n)(?:velocity|vel)",
    "velocity_east": r"(?:vel|velocity|v)(?:east|e)|(?:east|e)(?:velocity|vel)",
    "velocity_down": r"(?:vel|velocity|v)(?:down|d)|(?:down|d)(?:velocity|vel)",
    "velocity_up": r"(?:vel|velocity|v)(?:up|u)|(?:up|u)(?:velocity|vel)",
    "speed": r"(?:gnss|gps|ground|horizontal|location)?speed|speedoverground|sog|gspeed|speedmps",
    "course": r"bearing(?:degrees)?|locationcourse|course|courseoverground|cog|track"
    r"|headingofmotion|headmot",
    "position_sd": _POSITION_SD,
    "position_sd_north": rf"{_POSITION_SD}(?:north|n)|sdn|stdn|northsd|northstd|sdnorth|stdnorth",
    "position_sd_east": rf"{_POSITION_SD}(?:east|e)|sde|stde|eastsd|eaststd|sdeast|stdeast",
    "position_sd_down": rf"{_POSITION_SD}(?:down|d|up|u)|sdu|sdd|stdu|stdd|"
    r"upsd|downsd|upstd|downstd",
    "horizontal_accuracy": r"(?:location)?(?:hacc|horizontalaccuracy|hdev|accuracy|eph)"
    r"|accuracymeters",
    "vertical_accuracy": r"(?:location)?(?:vacc|verticalaccuracy|vdev|epv)|verticalaccuracymeters",
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
    """A column whose meaning was found."""

    role: str  # what it is, e.g. "gyro_x".
    name: str  # its name in the file
    unit: str  # its unit as written; empty when the file does not say.


@lru_cache(1024)
def split_unit(name: str) -> tuple[str, str]:
    """Split the name of a column into the bare name and the unit."""
    match = _NUMBERED.match(name)
    if match:
        stem, unit = split_unit(match["name"])
        # PX4 writes gyro_rad[0] for an angular rate in rad/s.
        return f"{stem}_{'xyz'[int(match['axis'])]}", "rad/s" if unit == "rad" else unit
    match = _BRACKET.match(name)
    if match and (is_unit(match["unit"]) or not match["unit"]):
        return match["name"].strip(), match["unit"].strip()
    parts = re.sub(r"#\d+$", "", name).split("_")
    for count in (3, 2, 1):
        tail = "_".join(parts[-count:])
        if len(parts) > count and is_unit(tail) and not _part_of_name(parts, count):
            return "_".join(parts[:-count]), tail
    return name, ""


@lru_cache(1024)
def bare(name: str) -> str:
    """Return a name in lower case, letters and digits only."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit of anything that recordings hold."""
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
    parts = {name: split_unit(name) for name in names}
    for name, (stem, own_unit) in parts.items():
        unit = stated_units.get(name, own_unit)
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
    _refuse_twice(found, parts, roles)
    _complete_time(found, parts, ranks, stated_units)
    _behind_prefixes(found, parts, roles, stated_units)
    return found


def _refuse_twice(
    found: Mapping[str, Column], parts: Mapping[str, tuple[str, str]], roles: Mapping[str, str]
) -> None:
    """Raise when a name that plays a role stands twice in the header."""
    for name, (stem, _) in parts.items():
        plain = re.sub(r"#\d+$", "", name)
        if plain == name:
            continue
        text = bare(re.sub(r"#\d+$", "", stem))
        if any(c.name == plain and re.fullmatch(roles.get(r, "time"), text)
               for r, c in found.items()):  # fmt: skip
            raise InputError(
                f"two columns are named '{plain}'",
                cure="rename one of them, or say which is meant with columns=",
            )


def _complete_time(
    found: dict[str, Column],
    parts: Mapping[str, tuple[str, str]],
    ranks: Mapping[str, int],
    stated: Mapping[str, str],
) -> None:
    """Find time in ticks, and time in two columns of seconds and nanoseconds."""
    bares = {bare(name): name for name in reversed(list(parts))}
    for text, name in bares.items():
        match = re.fullmatch(rf"(?P<stem>.*?)(?P<whole>{_WHOLE})", text)
        if match is None or ranks.get("time", 99) < _TIMES.index("time"):
            continue
        stem = re.escape(match["stem"])
        part = next((n for t, n in bares.items() if re.fullmatch(stem + _PART, t)), None)
        if part is not None and part != name:
            found["time"] = Column("time", name, "s")
            found["time_fraction"] = Column("time_fraction", part, "ns")
            return
    if "time" in found:
        return
    for name, (stem, unit) in parts.items():
        whole = bare(name)
        match = _TICKS.fullmatch(whole) or _TICKS.fullmatch(bare(stem))
        if match:
            written = match["unit"] or match["behind"]
            ticks = next(u for k, u in _TICK_UNITS.items() if written.startswith(k))
            found["time"] = Column("time", name, stated.get(name, unit or ticks))
            return
    behind = [n for n, (stem, _) in parts.items() if _LATE_TIME.fullmatch(bare(stem))]
    if len(behind) == 1:
        found["time"] = Column("time", behind[0], stated.get(behind[0], parts[behind[0]][1]))


def _behind_prefixes(
    found: dict[str, Column],
    parts: Mapping[str, tuple[str, str]],
    roles: Mapping[str, str],
    stated: Mapping[str, str],
) -> None:
    """Find columns behind words of the maker, such as 'Shimmer_AB12_Gyro_X_CAL' or a path."""
    for sensor, stem in (("gyro", _LONG_GYRO), ("accel", _LONG_ACCEL)):
        if f"{sensor}_x" not in roles or any(f"{sensor}_{a}" in found for a in "xyz"):
            continue
        pattern = re.compile(rf"(?P<before>.*?){stem}(?P<kind>ln|raw|uncal)?(?P<axis>[xyz])"
                             r"(?:raw|uncal|calibrated|cal)?")  # fmt: skip
        sets: dict[str, dict[str, str]] = {}
        for name, (short, _) in parts.items():
            match = pattern.fullmatch(bare(short))
            if match and not re.search(r"user|gravity|delta|mag|bias|cov|var|std", match["before"]):
                sets.setdefault(match["before"], {})[match["axis"]] = name
        complete = [axes for axes in sets.values() if len(axes) == 3]
        if len(complete) == 1:
            for axis, name in complete[0].items():
                unit = stated.get(name, parts[name][1])
                found[f"{sensor}_{axis}"] = Column(f"{sensor}_{axis}", name, unit)


def counter_column(names: Sequence[str]) -> str | None:
    """Return the column that counts samples, if there is one."""
    found = [n for n in names if COUNTERS.fullmatch(bare(n))]
    packet = [n for n in found if "packet" in bare(n) or "count" in bare(n)]
    chosen = packet or found
    return chosen[0] if chosen else None


def unused_rates(
    names: Sequence[str], chosen: Iterable[Column], stated: Mapping[str, str]
) -> dict[str, list[str]]:
    """Return columns not used whose unit is that of an angular rate or an acceleration."""
    used = {c.name for c in chosen}
    result: dict[str, list[str]] = {}
    for name in names:
        if name in used:
            continue
        unit = stated.get(name, split_unit(name)[1])
        for kind in ("angular rate", "acceleration"):
            if unit and units.measures(unit, kind):
                result.setdefault(kind, []).append(name)
    return result


def _short(text: str) -> str:
    """Drop words that makers put before or behind the sensor: 'imugyrox', 'gyroxraw'."""
    text = re.sub(
        r"^(?:field|imu|sensor|body|raw|data)+(?=(?:gyr|acc|ang|lin|omega|[xyz](?:gyr|acc)))",
        "",
        text,
    )
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
    twice = [re.sub(r"#\d+$", "", n) for n in names if re.search(r"#\d+$", n)]
    if twice:
        wanted += f" (two columns are named '{twice[0]}')"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return InputError(
        f"no column for {wanted} among: {shown}",
        expected="names such as time_s, gyro_x_rad_s, accel_x_m_s2, latitude_deg",
        cure=f"say which column is which with {option}=",
        where=where,
    )
