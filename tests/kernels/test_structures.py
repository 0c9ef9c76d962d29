"""Structures: what they refuse, and that a kernel sees the arrays of the very object."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import FilterState
from schuler.kernels.structure_fields import Counter, Matrix, Places, Vector3, reals, seen
from schuler.kernels.structures import carve, size_of, structure

Array = NDArray[np.float64]


@structure
class State:
    position: Vector3
    covariance: Matrix
    places: Places
    count: Counter


@structure
class Whole:
    factor: float
    state: State
    samples: Annotated[Array, seen(reals(None, 3))]
    number: int
    active: bool


@kernel()
def take(state: State, row: Array) -> None:
    for i in range(3):
        state.position[i] += row[i]
    state.covariance[1, 2] += state.position[0]
    state.count[0] += 1


@kernel()
def take_all(w: Whole, begin: int) -> float:
    for k in range(begin, w.samples.shape[0]):
        take(w.state, w.samples[k])
    if not w.active:
        return -1.0
    return w.factor * w.number + w.state.covariance.shape[1] + w.state.places[1]


def parts() -> dict[str, Array]:
    return {
        "position": np.array([1.0, 2.0, 3.0]),
        "covariance": np.zeros((2, 4)),
        "places": np.array([7, 8]),
        "count": np.array([0]),
    }


def whole(active: bool = True) -> Whole:
    return Whole(0.5, State(**parts()), np.arange(6.0).reshape(2, 3), 3, active)


def check() -> None:
    """The same with and without the compiler."""
    w = whole()
    assert take_all(w, 0) == 0.5 * 3 + 4 + 8
    np.testing.assert_array_equal(w.state.position, [1.0 + 3.0, 2.0 + 5.0, 3.0 + 7.0])
    # the running position was 1 + 0, then 1 + 0 + 3
    assert w.state.covariance[1, 2] == 1.0 + 4.0
    assert np.count_nonzero(w.state.covariance) == 1
    assert w.state.count[0] == 2
    assert take_all(whole(active=False), 2) == -1.0


def test_a_kernel_reads_and_writes_the_fields_of_nested_structures() -> None:
    check()


def test_without_the_compiler_it_is_a_plain_object() -> None:
    code = "import test_structures as t; assert not hasattr(t.take, 'py_func'); t.check()"
    subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parent,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        (
            "position",
            np.zeros(4),
            r"State.position is an array \(4,\) .*, should be .*\(3\)",
        ),
        ("position", np.zeros(3, np.float32), "float32, should be a C-contiguous array"),
        ("position", [1.0, 2.0, 3.0], "State.position is list, should be"),
        ("covariance", np.zeros(4), r"State.covariance is an array \(4,\) of float64"),
        ("covariance", np.zeros((4, 4)).T[::2], "with strides"),
        ("covariance", np.zeros((3, 2)).T, "with strides"),
        ("places", np.zeros(2), "of float64, should be .* of int64"),
        ("count", np.zeros(2, np.int64), r"should be .*\(1\) of int64"),
    ],
)
def test_what_has_the_wrong_shape_or_type_reaches_no_kernel(
    field: str, value: object, complaint: str
) -> None:
    with pytest.raises(TypeError, match=complaint):
        State(**parts() | {field: value})  # type: ignore[arg-type]


def test_numbers_and_nested_structures_are_looked_at_too() -> None:
    good = [0.5, State(**parts()), np.zeros((1, 3)), 3, True]
    Whole(*good)  # type: ignore[arg-type]
    Whole(1, *good[1:])  # type: ignore[arg-type]
    for place, value, complaint in (
        (0, "a", "Whole.factor is str, should be float"),
        (1, whole(), "Whole.state is Whole, should be State"),
        (3, 1.5, "Whole.number is float, should be int"),
        (3, True, "Whole.number is bool, should be int"),
        (4, 1, "Whole.active is int, should be bool"),
    ):
        wrong = [*good[:place], value, *good[place + 1 :]]
        with pytest.raises(TypeError, match=complaint):
            Whole(*wrong)  # type: ignore[arg-type]


def test_only_what_is_seen_may_be_read_only_and_both_are_one_type() -> None:
    fixed = np.zeros(3)
    fixed.flags.writeable = False
    with pytest.raises(TypeError, match=r"State\.position is a read-only array"):
        State(**parts() | {"position": fixed})
    w = whole()
    rows = w.samples.copy()
    rows.flags.writeable = False
    again = Whole(w.factor, w.state, rows, w.number, w.active)
    assert take_all(w, 1) == take_all(again, 1)
    assert len(take_all.signatures) == 1  # type: ignore[attr-defined]
    # the inner one is not compiled where the outer one comes from the cache
    assert len(take.signatures) <= 1  # type: ignore[attr-defined]


def test_fields_cannot_be_exchanged() -> None:
    w = whole()
    with pytest.raises(AttributeError):
        w.factor = 2.0  # type: ignore[misc]


def test_copies_have_arrays_and_addresses_of_their_own() -> None:
    for copied in (copy.deepcopy(w := whole()), pickle.loads(pickle.dumps(w := whole()))):
        take_all(copied, 0)
        assert copied.state.count[0] == 2
        assert w.state.count[0] == 0
        np.testing.assert_array_equal(w.state.position, [1.0, 2.0, 3.0])


def test_an_unknown_kind_of_field_is_named() -> None:
    with pytest.raises(TypeError, match=r"Odd.name is declared as <class 'str'>, should be"):

        @structure
        class Odd:
            name: str


def test_views_cover_the_memory_they_are_carved_from() -> None:
    shapes = {"a": (2, 3), "b": (0,), "c": (4,)}
    memory = np.zeros(size_of(shapes))
    for number, view in enumerate(carve(shapes, memory).values()):
        view[...] += number + 1.0
    np.testing.assert_array_equal(memory, [1.0] * 6 + [3.0] * 4)


def test_a_copied_state_still_lives_in_its_memory() -> None:
    state = FilterState.empty(3, 2, accumulating=True)
    for copied in (copy.deepcopy(state), pickle.loads(pickle.dumps(state))):
        copied.memory[:] = np.arange(copied.memory.size)
        copied.counters[:] = 5
        assert copied.covariance[0, 1] == copied.covariance[0, 0] + 1.0 > 1.0
        assert copied.samples[0] == 5
        assert not state.memory.any()
