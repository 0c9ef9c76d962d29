"""A negative number after an option is its value, not another option."""

from __future__ import annotations

import pytest

from schuler.cli.app import _joined, check

DRIVE = ("--imu", "imu.csv", "--gnss", "gnss.csv")


@pytest.mark.parametrize("verb", ["navigate", "outages"])
@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--time-offset", "-0.0149,-0.0228"),
        ("--time-offset", "-.5"),
        ("--lever-arm", "-1,0,0"),
        ("--mounting", "-1,2,-170"),
        ("--heading", "-90"),
    ],
)
def test_negative_first_numbers_need_no_equals_sign(verb: str, option: str, value: str) -> None:
    check([verb, *DRIVE, option, value], "here")


def test_only_values_are_joined() -> None:
    assert _joined(["a", "--x", "-1,0", "--y=2", "-3", "--json", "-", "--", "-4"]) == [
        *("a", "--x=-1,0", "--y=2", "-3", "--json=-", "--", "-4")
    ]
    assert _joined(["--quiet", "-v", "--out", "--json"]) == ["--quiet", "-v", "--out", "--json"]
