"""Any trajectory against a reference: errors that are known are found, wrong frames are refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schuler import (
    InputError,
    Track,
    Trajectory,
    compare_results,
    dcm_from_euler,
    evaluate_trajectory,
    read_track,
)
from schuler.cli import main
from schuler.earth import geodetic_from_ned, ned_from_ecef_rotation
from schuler.io.registry import trajectory_format
from schuler.report.sections.navigation.accuracy import claims_judged
from schuler.types import FloatArray

ORIGIN = np.array([np.radians(48.1), np.radians(11.5), 520.0])
TIME = np.arange(0.0, 120.0, 0.02)


def way(time: FloatArray = TIME) -> FloatArray:
    return np.column_stack([200.0 * np.sin(0.05 * time), 8.0 * time, -3.0 * np.sin(0.1 * time)])


def truth(time: FloatArray = TIME) -> Trajectory:
    speed = np.gradient(way(time), time, axis=0)
    heading = np.arctan2(speed[:, 1], speed[:, 0])
    turned = dcm_from_euler(0.02 * np.sin(time), 0.01 * np.cos(time), heading)
    return Trajectory(time, geodetic_from_ned(way(time), ORIGIN), speed, turned)


def local(positions: FloatArray, name: str = "odometry") -> Track:
    return Track(TIME, positions, local=True, name=name)


def test_a_known_error_is_found_in_every_direction_and_in_windows() -> None:
    off = np.tile((0.3, -0.4, 1.2), (TIME.size, 1))
    off[TIME > 60.0, 0] += 3.0
    moved = replace(truth(), position=geodetic_from_ned(way() + off, ORIGIN))
    found = evaluate_trajectory(moved, truth(), windows=((70.0, 20.0),))
    assert found.error[0] == pytest.approx((0.3, -0.4, 1.2), abs=1e-3)
    assert found.error[-1] == pytest.approx((3.3, -0.4, 1.2), abs=2e-3)
    assert found.ate_m["rms"] == pytest.approx(np.sqrt(np.mean((off**2).sum(axis=1))), rel=1e-3)
    assert found.windows[0].max_m == pytest.approx(np.hypot(3.3, 0.4), rel=1e-3)
    # the jump of 3 m is seen by one pair of moments in six, 10 s of 60 s apart
    over = {(r.over, r.unit): r for r in found.relative}
    assert over[10.0, "s"].worst_m == pytest.approx(3.0, rel=1e-2)
    assert over[10.0, "s"].rms_m == pytest.approx(3.0 * np.sqrt(10.0 / 110.0), rel=0.02)
    assert found.attitude_rms_rad == pytest.approx([0.0] * 3, abs=1e-6)


def test_attitude_errors_have_the_sign_of_the_filter() -> None:
    psi = np.array([0.01, -0.02, 0.03])
    cross = np.array([[0, -psi[2], psi[1]], [psi[2], 0, -psi[0]], [-psi[1], psi[0], 0]])
    u, _, vt = np.linalg.svd(np.eye(3) - cross)
    tilted = replace(truth(), rotation=(u @ vt) @ truth().rotation)
    found = evaluate_trajectory(tilted, truth())
    assert found.attitude_error is not None
    assert found.attitude_error[100] == pytest.approx(psi, abs=1e-4)


def test_honest_claims_are_judged_honest_and_others_are_not() -> None:
    rng = np.random.default_rng(20)
    noise = rng.normal(0.0, 0.5, way().shape)
    half = np.full_like(noise, 0.5)
    here = Track(TIME, geodetic_from_ned(way() + noise, ORIGIN), position_sd=half)
    claims = evaluate_trajectory(here, truth()).claims
    assert claims is not None
    # 18000 independent numbers: standard errors 0.0016 and 0.0105
    assert np.mean(list(claims["within_2_sigma"].values())) == pytest.approx(0.9545, abs=0.007)
    assert claims["nees_per_axis"] == pytest.approx(1.0, abs=0.045)
    bold = replace(here, position_sd=np.full_like(noise, 0.25))
    again = evaluate_trajectory(bold, truth()).claims
    assert again is not None
    assert again["nees_per_axis"] == pytest.approx(4.0, abs=0.2)


def test_local_axes_are_turned_and_mirrored_or_foreign_ones_are_refused() -> None:
    turn = dcm_from_euler(0.1, -0.2, 2.0)
    turned = local(way() @ turn.T + (5.0, 6.0, 7.0))
    found = evaluate_trajectory(turned, truth())
    # heights are above the ellipsoid, which bends 0.07 m away from a plane over a kilometre
    assert found.ate_m["max"] < 0.1
    assert any("in local axes, so it was turned by" in note for note in found.notes)
    swapped = local(way()[:, [1, 0, 2]])
    with pytest.raises(InputError, match="odometry is mirrored against trajectory"):
        evaluate_trajectory(swapped, truth())
    with pytest.raises(InputError, match=r"is in another frame than b: .* apart"):
        evaluate_trajectory(turned, local(way(), "b"))
    assert evaluate_trajectory(turned, local(way(), "b"), align="turn").ate_m["max"] < 1e-6
    moved = local(way() + np.array([5.0, 6.0, 7.0]))
    assert evaluate_trajectory(moved, local(way(), "b"), align="shift").ate_m["max"] < 1e-9
    degrees = replace(truth(), position=truth().position * (1.01, 1.0, 1.0))
    with pytest.raises(InputError, match="another frame"):
        evaluate_trajectory(degrees, truth())


@pytest.mark.parametrize(
    ("axes", "written"),
    [
        ("east, north, up", lambda t: t.velocity[:, [1, 0, 2]] * (1.0, 1.0, -1.0)),
        ("north, east, up", lambda t: t.velocity * (1.0, 1.0, -1.0)),
        (
            "forward, right, down of the body",
            lambda t: np.einsum("nji,nj->ni", t.rotation, t.velocity),
        ),
        ("ECEF", lambda t: t.velocity @ ned_from_ecef_rotation(*ORIGIN[:2])),
    ],
)
def test_velocities_in_other_axes_than_the_positions_are_named(
    axes: str, written: Callable[[Trajectory], FloatArray]
) -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(0.0, (0.02, 0.02, 0.02), way().shape)
    true = replace(truth(), position=geodetic_from_ned(way() + noise, ORIGIN))
    found = evaluate_trajectory(truth(), replace(true, velocity=written(truth())))
    assert any(f"as {axes}" in note for note in found.notes), found.notes
    assert np.max(found.velocity_rms_m_s) < 0.01
    assert not any("other axes" in n for n in evaluate_trajectory(truth(), true).notes)
    # what fits nothing is judged as it stands
    wrong = replace(truth(), velocity=truth().velocity + np.array([0.0, 3.0, 0.0]))
    assert evaluate_trajectory(wrong, true).velocity_rms_m_s == pytest.approx([0, 3, 0], abs=0.01)


def test_other_times_are_refused_shifted_or_bridged() -> None:
    late = replace(truth(), time=TIME + 1.7e9)
    with pytest.raises(InputError, match=r"no overlap in time.*one counts Unix time"):
        evaluate_trajectory(truth(), late)
    assert evaluate_trajectory(truth(), late, time_offset=-1.7e9).ate_m["max"] < 1e-3
    slow = truth(np.arange(0.0, 120.0, 1.0))
    found = evaluate_trajectory(truth(), slow)
    assert (found.samples, found.ate_m["max"] < 1e-6) == (120, True)
    between = evaluate_trajectory(truth(np.arange(0.25, 118.0, 1.0)), slow)
    told = next(n for n in between.notes if "a straight line is taken" in n)
    # the way bends by 200 m · (0.05/s)² = 0.5 m/s²: 1/8 of it in the middle of a second
    assert "off by up to 0.062 m" in told
    assert 0.03 < between.ate_m["max"] < 0.065


def test_an_antenna_is_reached_by_the_lever_arm() -> None:
    arm = np.array([1.0, 0.5, -1.5])
    antenna = geodetic_from_ned(way() + truth().rotation @ arm, ORIGIN)
    seen = Track(TIME, antenna)
    assert evaluate_trajectory(truth(), seen).ate_m["rms"] > 1.5
    assert evaluate_trajectory(truth(), seen, lever_arm=arm).ate_m["max"] < 0.01


@pytest.mark.parametrize(
    "form", ["tum", "euroc", "rtklib", "sbet", "kf-gins-nav", "csv", "parquet"]
)
def test_every_written_form_is_read_back_and_judged(form: str, tmp_path: Path) -> None:
    few = truth(np.arange(0.0, 60.0, 0.1))
    one = trajectory_format(form)
    path = tmp_path / f"track{one.suffixes[0]}"
    assert one.write_trajectory is not None
    half = np.full(few.size, 0.5)
    sd = {f"pos_std_{d}_m": half for d in ("north", "east", "down")}
    sd |= {f"vel_std_{d}_m_s": half for d in ("north", "east", "down")}
    one.write_trajectory(path, few.to_columns() | sd)
    found = evaluate_trajectory(read_track(path), few)
    assert found.samples >= 590
    assert found.ate_m["max"] < 0.02
    if form != "rtklib":
        assert found.attitude_error is not None
        assert np.abs(found.attitude_error).max() < 1e-4


def test_the_verb_tells_the_answer_and_two_of_its_results_compare(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = truth(np.arange(0.0, 60.0, 0.1))
    few.to_parquet(tmp_path / "truth.parquet")
    for name, metres in (("good", 1.0), ("bad", 2.0)):
        off = geodetic_from_ned(way(few.time) + np.array([metres, 0.0, 0.0]), ORIGIN)
        replace(few, position=off).to_parquet(tmp_path / f"{name}.parquet")
        code = main(
            ["evaluate", f"{tmp_path}/{name}.parquet", "--truth", f"{tmp_path}/truth.parquet",
             "--json", f"{tmp_path}/{name}.json"]
        )  # fmt: skip
        assert code == 0
    assert "bad.parquet is 2.00 m off truth.parquet horizontally" in capsys.readouterr().out
    assert main(["compare", f"{tmp_path}/good.json", f"{tmp_path}/bad.json"]) == 0
    row = next(x for x in capsys.readouterr().out.splitlines() if "horizontal_m.rms" in x)
    assert [float(x) for x in row.split()[1:4]] == pytest.approx([1.0, 2.0, 50.0], rel=1e-4)


def test_comparison_counts_in_standard_errors_and_refuses_strangers() -> None:
    a = {"k": {"value": 1.0, "standard_error": 0.3}, "unit": "m", "own": 3}
    b = {"k": {"value": 2.0, "standard_error": 0.4}, "unit": "km"}
    found = compare_results([a, b])
    assert found.numbers[0].sigmas == pytest.approx(2.0)
    assert found.words == (("unit", ("m", "km")),)
    assert found.lacking == ("own",)
    with pytest.raises(InputError, match="no number in common"):
        compare_results([{"a": 1.0}, {"b": 2.0}])


def test_another_clock_is_named_with_what_would_remain() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 400.0, 0.5)

    def way(at: FloatArray) -> FloatArray:
        return np.column_stack(
            [300.0 * np.sin(at / 40.0) + 5.0 * at, 200.0 * np.cos(at / 25.0), 3.0 * np.sin(at / 60)]
        )

    noise = 0.05 * rng.standard_normal((time.size, 3))
    truth = Track(time, way(time), local=True)
    early = Track(time, way(time + 0.4) + noise, local=True)
    found = evaluate_trajectory(early, truth)
    shift = found.time_shift
    assert shift is not None
    assert shift.offset_s == pytest.approx(-0.4, abs=4.0 * shift.sd_s + 2e-4)
    assert shift.explained > 0.99
    assert shift.remaining_m == pytest.approx(0.05 * np.sqrt(3.0), rel=0.1)
    assert "--truth-offset" in claims_judged(found)[0]
    mended = evaluate_trajectory(early, truth, time_offset=shift.offset_s)
    assert mended.ate_m["rms"] == pytest.approx(shift.remaining_m, rel=0.05)
    assert mended.time_shift is None
    good = Track(time, way(time) + noise, local=True)
    assert evaluate_trajectory(good, truth).time_shift is None


def test_what_a_result_is_asked_for_comes_first_however_little_it_changes() -> None:
    one = {"findings": [{"value": 1.0}], "samples": 10.0, "horizontal_m": {"rms": 2.0}}
    two = {"findings": [{"value": 9.0}], "samples": 20.0, "horizontal_m": {"rms": 2.2}}
    keys = [n.key for n in compare_results({"a": one, "b": two}).numbers]
    assert keys == ["horizontal_m.rms", "samples", "findings.0.value"]
