"""Units: literal factors of the specification, spellings, refusals, round trips."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.errors import UnitError
from schuler.units import KINDS, format_value, kind_of, parse, scale

DEG = math.pi / 180.0

# Spec section 0: factor of one unit, written out as numbers.
FACTORS = [
    ("m/s/sqrt(h)", "accel white noise", 1.0 / 60.0),
    ("deg/sqrt(h)", "gyro white noise", 2.908882086657216e-4),
    ("m/s/h", "accel bias instability", 1.0 / 3600.0),
    ("deg/h", "gyro bias instability", 4.84813681109536e-6),
    ("m/s/h^(3/2)", "accel random walk", 4.62962962962963e-6),
    ("deg/h^(3/2)", "gyro random walk", 8.080228018492267e-8),
    ("ug/sqrt(Hz)", "accel white noise", 9.80665e-6),
    ("mg", "accel bias instability", 9.80665e-3),
    ("mGal", "accel bias", 1e-5),
    ("ppm", "scale factor", 1e-6),
    ("deg/s/sqrt(Hz)", "gyro white noise", 0.017453292519943295),
    ("deg/h^2", "gyro ramp", DEG / 3600.0**2),
    ("m/s/h^2", "accel ramp", 1.0 / 3600.0**2),
    ("arcsec", "gyro quantization", DEG / 3600.0),
    ("ms", "time", 1e-3),
    ("us", "time", 1e-6),
    ("ns", "time", 1e-9),
    ("min", "correlation time", 60.0),
    ("kHz", "frequency", 1000.0),
    ("ft/s^2", "acceleration", 0.3048),
    ("g", "acceleration", 9.80665),
    ("rpm", "angular rate", 2.0 * math.pi / 60.0),
    ("dps", "angular rate", DEG),
]

SPELLINGS = [
    ("gyro white noise", DEG / 60.0, "deg/√h deg/rt-h °/√h deg/rtHr deg/sqrt(hr) deg/h^0.5"),
    ("gyro white noise", DEG / 60.0, "deg/hr^(1/2) deg/√hour degrees/sqrt(hours) deg/h½"),
    ("gyro white noise", DEG, "deg/s/√Hz dps/rtHz (deg/s)/sqrt(Hz) °/s/√Hz deg/sec/sqrt(hz)"),
    ("accel white noise", 9.80665e-6, "µg/√Hz μg/√Hz ug/rt-Hz ug/Hz^0.5"),
    ("accel white noise", 1.0, "m/s²/√Hz m/s^2/sqrt(Hz) (m/s^2)/sqrt(Hz) m/s/√s m/s2/rtHz"),
    ("acceleration", 1.0, "m/s^2 m/s² m_s2 m/s**2 [m/s^2] m·s⁻² m*s^-2"),
    ("angular rate", DEG, "deg/s deg_s °/s deg_per_s DEG/S degrees/second"),
    ("accel random walk", 1.0 / 216000.0, "m/s/h^1.5 m/s/h/√h m/s/h^(3/2) m/s/h^3/2"),
]


@pytest.mark.parametrize(("unit", "kind", "factor"), FACTORS)
def test_factor_of_the_specification(unit: str, kind: str, factor: float) -> None:
    assert scale(unit, kind) == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize(("kind", "factor", "spellings"), SPELLINGS)
def test_spellings_mean_the_same(kind: str, factor: float, spellings: str) -> None:
    for unit in spellings.split():
        assert parse(f"2.5 {unit}", kind) == pytest.approx(2.5 * factor, rel=1e-14), unit
    assert parse("2.5 deg s^-1 Hz^-0.5", "gyro white noise") == pytest.approx(2.5 * DEG)


def test_datasheet_value_of_the_adis16405() -> None:
    # 2.0 deg/√h is the same sensor as 0.0333 deg/s/√Hz.
    per_root_hour = parse("2.0 deg/sqrt(h)", "gyro white noise")
    per_root_hertz = parse("0.0333333333333 deg/s/sqrt(Hz)", "gyro white noise")
    assert per_root_hour == pytest.approx(per_root_hertz, rel=1e-11)


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("3 mg", "gyro bias instability", "is an acceleration"),
        ("3 deg/h", "accel bias instability", "is an angular rate"),
        ("3 deg/s", "gyro white noise", "is an angular rate"),
        ("3 deg/sqrt(h)", "gyro random walk", "another kind"),
        ("3", "gyro bias", "has no unit"),
        ("0,3 mg", "accel bias", "decimal comma"),
        ("three mg", "accel bias", "does not begin with a number"),
        ("3 smoots", "accel bias", "'smoots'"),
        ("3 deg/", "angle", "ends in an operator"),
        ("3 (deg", "angle", "not closed"),
        ("3 deg)", "angle", "bracket too many"),
        ("1e999 deg", "angle", "finite"),
        ("3 " + "(" * 5000, "angle", "too long"),
        ("3 m^99", "length", "out of range"),
        ("3 m^1/0", "length", "over zero"),
    ],
)
def test_refused_in_one_clear_line(text: str, kind: str, said: str) -> None:
    with pytest.raises(UnitError) as caught:
        parse(text, kind)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bare_number_is_si_and_not_finite_is_refused() -> None:
    assert parse(0.25, "gyro white noise") == 0.25
    assert parse("0.25", "accel bias", default_unit="mg") == pytest.approx(0.25 * 9.80665e-3)
    for bad in (math.nan, math.inf):
        with pytest.raises(UnitError):
            parse(bad, "gyro white noise")


def test_names_of_kinds_are_forgiving() -> None:
    assert kind_of("Gyroscope_White_Noise") is KINDS["gyro white noise"]
    assert kind_of("accelerometer turn-on bias") is KINDS["accel bias"]
    assert kind_of("gyro quantisation") is KINDS["gyro quantization"]
    with pytest.raises(UnitError, match="not a kind"):
        kind_of("gyro colour")


@given(
    kind=st.sampled_from(sorted(KINDS)),
    units=st.sampled_from(["datasheet", "si"]),
    value=st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12) | st.just(0.0),
)
def test_written_value_reads_back(kind: str, units: str, value: float) -> None:
    text = format_value(value, kind, units)
    assert parse(text, kind) == pytest.approx(value, rel=1e-11)


@given(st.text(max_size=30))
def test_any_text_gives_a_number_or_a_unit_error(text: str) -> None:
    try:
        value = parse("1 " + text, "angular rate")
    except UnitError as error:
        assert "\n" not in str(error)
    else:
        assert math.isfinite(value)


def test_datasheet_text_is_what_a_person_would_write() -> None:
    assert format_value(0.24 * DEG / 60.0, "gyro white noise") == "0.24 deg/sqrt(h)"
    assert format_value(4.6 / 3600.0, "accel bias instability") == "4.6 m/s/h"
    assert format_value(0.0045, "accel white noise", "si") == "0.0045 m/s^2/sqrt(Hz)"
    assert format_value(9.80665e-4, "accel white noise", "ug/sqrt(Hz)", 4) == "100 ug/sqrt(Hz)"
