"""Keywords that several functions share: none is lost, and a wrong one is told the right one."""

import inspect
import re
from dataclasses import fields

import numpy as np
import pytest

import schuler
from schuler.errors import InputError
from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.settings import NavigationOptions, NavigationSettings
from schuler.simulation.gnss import ReceiverOptions, _Receiver, simulate_gnss
from schuler.simulation.receivers import simulate_receiver

# function, arguments without which it cannot be called; none of them is looked at
NAVIGATING = [
    (schuler.navigate, (None, None)),
    (schuler.navigate_array, (None, None)),
    (schuler.evaluate_outages, (None, None)),
    (schuler.tune_noise, (None, None, None)),
    (prepare, (None, None)),
]
RECEIVING = [
    (simulate_gnss, (None,), {"position_sd": 1.0, "velocity_sd": None}),
    (simulate_receiver, (None, None), {}),
]


@pytest.mark.parametrize(
    ("options", "settings"),
    [(NavigationOptions, NavigationSettings), (ReceiverOptions, _Receiver)],
)
def test_options_are_those_that_the_settings_hold(options: type, settings: type) -> None:
    assert list(options.__annotations__) == [f.name for f in fields(settings) if f.init]


@pytest.mark.parametrize(
    ("function", "settings"), [(schuler.navigate, NavigationSettings), (simulate_gnss, _Receiver)]
)
def test_every_option_is_documented_once_with_its_default(function, settings) -> None:
    text = inspect.getdoc(function) or ""
    for field in (f for f in fields(settings) if f.init):
        told = re.findall(rf"^(?:[a-z_]+, )*{field.name}\b.* : .*default (.+)$", text, re.MULTILINE)
        assert len(told) == 1, field.name
        if field.name != "measurements":
            assert eval(told[0], {"radians": np.radians}) == field.default, field.name
    assert "**options" in text or "options" in str(inspect.signature(function))


@pytest.mark.parametrize(("function", "given"), NAVIGATING)
@pytest.mark.parametrize(
    ("wrong", "right"), [("lever_am", "lever_arm"), ("turn_on_acc", "turn_on_accel")]
)
def test_unknown_option_of_navigation_is_told_the_nearest(function, given, wrong, right) -> None:
    with pytest.raises(InputError, match=rf"no option '{wrong}'.*did you mean '{right}'"):
        function(*given, **{wrong: 0.1})


@pytest.mark.parametrize(("function", "given", "needed"), RECEIVING)
def test_unknown_option_of_a_receiver_is_told_the_nearest(function, given, needed) -> None:
    with pytest.raises(InputError, match=r"no option 'outage'.*did you mean 'outages'"):
        function(*given, rng=np.random.default_rng(0), outage=((1.0, 2.0),), **needed)


def test_own_keyword_of_a_function_is_found_too() -> None:
    with pytest.raises(InputError, match="did you mean 'smooth'"):
        schuler.navigate(None, None, smoth=True)


def test_option_that_a_function_decides_itself_is_refused() -> None:
    with pytest.raises(InputError, match="tune_noise sets 'tune_noise' itself"):
        schuler.tune_noise(None, None, None, tune_noise=True)
