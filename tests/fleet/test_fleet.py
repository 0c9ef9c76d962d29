"""A batch over many logs: resumed, complete, the same whoever works; what it says of a fleet."""

from __future__ import annotations

import json
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler import NoiseModel, WhiteNoise
from schuler.cli.app import run
from schuler.cli.loading import load_noise
from schuler.cli.options.files import OfSensor
from schuler.data.imu_calibration import ImuCalibration
from schuler.errors import InputError
from schuler.execution import workers
from schuler.fleet import (
    BatchSettings,
    FleetDatabase,
    LogEntry,
    known_sensor,
    list_logs,
    run_batch,
    summarise_fleet,
)
from schuler.fleet.summary import extreme_deviates, paule_mandel
from schuler.noise.effects import Effect

DENSITY = 1e-4


def write_log(path: Path, rng: np.random.Generator, loud: float = 1.0) -> None:
    """Write five minutes of white noise at 20 Hz."""
    n = 6000
    gyro = loud * DENSITY * np.sqrt(20.0) * rng.standard_normal((n, 3))
    accel = 0.01 * rng.standard_normal((n, 3)) + np.array([0.0, 0.0, -9.81])
    columns = {"time_s": np.arange(n) / 20.0}
    for name, unit, values in (("gyro", "rad_s", gyro), ("accel", "m_s2", accel)):
        columns |= {f"{name}_{a}_{unit}": values[:, k] for k, a in enumerate("xyz")}
    polars.DataFrame(columns).write_parquet(path)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six sensors, one of them three times as loud; a broken log and one that is not there."""
    folder = tmp_path_factory.mktemp("fleet")
    rng = np.random.default_rng(20261)
    rows = []
    for k in range(6):
        write_log(folder / f"s{k}.parquet", rng, 3.0 if k == 2 else 1.0)
        rows.append((f"s{k}.parquet", "X", f"SN{k}", "2026-01-01"))
    (folder / "broken.csv").write_text("time_s,gyro_x\n1,2\n")
    rows += [("broken.csv", "X", "SN8", ""), ("gone.csv", "X", "SN9", "")]
    frame = polars.DataFrame(rows, ("file", "sensor", "serial", "date"), orient="row")
    frame.write_csv(folder / "logs.csv")
    return folder


def calibration_of(gyro_bias: float) -> ImuCalibration:
    """A calibration that only takes off a bias."""
    one, none = np.eye(3), np.zeros((3, 3))
    return ImuCalibration(
        "SN1", one, none, np.zeros(3), np.zeros(3), one, none, np.array([gyro_bias, 0.0, 0.0]),
        np.zeros(3), none, none, 6, 0, 0.0, 0.0,
    )  # fmt: skip


def figures(database: FleetDatabase) -> list[object]:
    return [(m.serial, m.axis, m.name, m.value, m.standard_error) for m in database.measurements()]


def test_a_batch_finds_the_loud_sensor_and_lists_what_failed(fleet: Path, tmp_path: Path) -> None:
    entries, _ = list_logs(fleet / "logs.csv")
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        done = run_batch(entries, database)
        summary = summarise_fleet(database)
    assert (done.done, done.failed, done.known) == (6, 2, 0)
    assert {Path(f).name for f, _ in done.failures} == {"broken.csv", "gone.csv"}
    assert {o.serial for o in summary.outliers} == {"SN2"}
    assert all(o.ratio == pytest.approx(3.0, rel=0.05) for o in summary.outliers)
    assert summary.worst[0][:2] == ("X", "SN2")
    white = next(p for p in summary.parameters if (p.axis, p.name) == ("gyro_x", "N"))
    assert not white.shared
    still = next(p for p in summary.parameters if (p.axis, p.name) == ("accel_x", "N"))
    assert still.shared
    assert still.value == pytest.approx(0.01 / np.sqrt(20.0), abs=4.0 * still.standard_error)


def test_a_stopped_batch_goes_on_and_any_executor_gives_the_same(
    fleet: Path, tmp_path: Path
) -> None:
    entries, _ = list_logs(fleet / "logs.csv")
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        run_batch(entries[:3], database)
        later = run_batch(entries, database, executor=workers(1))
        assert (later.done, later.failed, later.known) == (3, 2, 3)
        one = figures(database)
    with FleetDatabase(tmp_path / "b.sqlite") as database, ThreadPoolExecutor(2) as threads:
        run_batch(entries, database, executor=threads)
        assert figures(database) == one


def test_other_settings_or_another_file_are_done_again_and_replace_the_old(
    fleet: Path, tmp_path: Path
) -> None:
    write_log(tmp_path / "a.parquet", np.random.default_rng(1))
    entry = LogEntry(tmp_path / "a.parquet", serial="S")
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        assert run_batch([entry], database).done == 1
        assert run_batch([entry], database).known == 1
        assert run_batch([entry], database, BatchSettings(model="W")).done == 1
        write_log(tmp_path / "a.parquet", np.random.default_rng(22), 2.0)
        assert run_batch([entry], database).done == 1
        assert len(database.logs()) == 1


def test_a_log_that_kills_its_worker_is_listed(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from concurrent.futures import BrokenExecutor, Executor, Future

    from schuler.execution import lent
    from schuler.fleet.work import work_on

    class Fragile(Executor):
        def submit(self, fn, /, *arguments, **options):  # type: ignore[no-untyped-def]
            future: Future[object] = Future()
            if "s1.parquet" in str(arguments):
                future.set_exception(BrokenExecutor("killed"))
            else:
                future.set_result(fn(*arguments, **options))
            return future

    assert work_on.__module__ == "schuler.fleet.work"
    entries, _ = list_logs(fleet / "logs.csv")
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        done = run_batch(entries[:3], database, executor=lent(Fragile()))
    assert done.done == 2
    assert "killed" in done.failures[0][1]


def test_the_noise_of_a_sensor_comes_from_the_database(fleet: Path, tmp_path: Path) -> None:
    entries, _ = list_logs(fleet / "logs.csv")
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        run_batch(entries[2:3], database)
    model = known_sensor(tmp_path / "a.sqlite", "SN2").noise
    assert isinstance(model, NoiseModel)
    density = model.process("gyro_x").parameters["white_noise.density"]
    assert density == pytest.approx(3.0 * DENSITY, rel=0.05)
    with pytest.raises(InputError, match=r"SN7.*SN2"):
        known_sensor(tmp_path / "a.sqlite", "SN7")


def test_a_sensor_is_known_by_files_or_by_the_database(tmp_path: Path) -> None:
    law = {"gyro_x": (Effect("temperature", "linear", 1e-5, 1e-6, 20.0),)}
    for date, density in (("2026-02-01", 2e-4), ("2025-02-01", 1e-4)):
        folder = tmp_path / "files" / "SN1" / date
        folder.mkdir(parents=True)
        model = NoiseModel.isotropic(WhiteNoise(density), WhiteNoise(7e-4))
        replace(model, effects=law).save(folder / "noise.yaml")
    calibration_of(0.02).save(tmp_path / "files" / "SN1" / "calibration.yaml")
    known = known_sensor(tmp_path / "files", "SN1")
    assert known.noise is not None
    density = known.noise.process("gyro_x").parameters["white_noise.density"]
    assert density == pytest.approx(2e-4)
    assert known.noise.effects["gyro_x"][0].coefficient == pytest.approx(1e-5)
    assert known.calibration is not None
    assert known.words == (
        "noise model of 2026-02-01", "temperature law of gyro_x", "calibration",
    )  # fmt: skip
    with pytest.raises(InputError, match=r"SN9.*SN1"):
        known_sensor(tmp_path / "files", "SN9")
    with pytest.raises(InputError, match="nothing is known"):
        known_sensor(tmp_path / "files", "..")
    # a log of a calibrated sensor brings its calibration into the database, and is calibrated
    write_log(tmp_path / "a.parquet", np.random.default_rng(3))
    entry = LogEntry(
        tmp_path / "a.parquet", serial="SN1", date="2026-03-01",
        calibration=tmp_path / "files" / "SN1" / "calibration.yaml",
    )  # fmt: skip
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        run_batch([entry], database)
    kept = known_sensor(tmp_path / "a.sqlite", "SN1")
    assert kept.calibration is not None
    assert kept.calibration.gyro_bias == pytest.approx([0.02, 0.0, 0.0])
    assert kept.words[0] == "noise model of 2026-03-01"


def test_options_name_a_sensor_and_its_registry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "SN1").mkdir()
    model = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(7e-4))
    model.save(tmp_path / "SN1" / "noise.yaml")
    monkeypatch.delenv("SCHULER_REGISTRY", raising=False)
    for wrong in (OfSensor("SN1"), OfSensor(None, tmp_path), OfSensor("SN2", tmp_path)):
        with pytest.raises(InputError):
            wrong.found()
    monkeypatch.setenv("SCHULER_REGISTRY", str(tmp_path))
    known = OfSensor("SN1").found()
    assert "no calibration" in capsys.readouterr().err
    found = load_noise(None, known)
    assert found is not None
    given = tmp_path / "other.yaml"
    NoiseModel.isotropic(WhiteNoise(3e-4), WhiteNoise(7e-4)).save(given)
    said = load_noise(given, known)
    assert said is not None
    assert said.process("gyro_x") != found.process("gyro_x")


def test_a_database_of_an_older_schuler_is_upgraded(tmp_path: Path) -> None:
    from schuler.fleet.database import UPGRADES

    old = sqlite3.connect(tmp_path / "old.sqlite")
    old.executescript(UPGRADES[0] + "PRAGMA user_version = 1;")
    old.execute(
        "INSERT INTO log VALUES ('k', 'f', 'X', 'SN1', '2026', NULL, 'noise', 'done', '', 1.0, "
        "1.0, 1.0, 'model', '[]')"
    )
    old.commit()
    old.close()
    with FleetDatabase(tmp_path / "old.sqlite") as database:
        assert database.newest("SN1", "model") == ("2026", "model")
        assert database.newest("SN1", "calibration") is None


def test_a_full_disk_loses_nothing(fleet: Path, tmp_path: Path) -> None:
    entries, _ = list_logs(fleet / "logs.csv")
    path = tmp_path / "a.sqlite"
    with FleetDatabase(path) as database:
        run_batch(entries[:2], database)
        database._connection.execute("PRAGMA max_page_count = 1")  # no page more than there are
        with pytest.raises(InputError, match=r"full.*make room"):
            run_batch([*entries[:6], *(replace(e, serial=9999 * "n") for e in entries)], database)
    with FleetDatabase(path) as database:
        assert len([r for r in database.logs() if r["status"] == "done"]) >= 2
        assert run_batch(entries, database).known >= 2
        assert len(database.logs()) == len(entries)


def test_one_sensor_in_two_logs_at_one_time(fleet: Path, tmp_path: Path) -> None:
    """Both are kept: which one is wrong only the user knows, so it is said each time."""
    rows = "file,serial,date\ns0.parquet,S,2026-01-01\ns1.parquet,S,2026-01-01\n"
    (fleet / "twice.csv").write_text(rows)
    entries, remarks = list_logs(fleet / "twice.csv")
    assert len(entries) == 2
    assert "one sensor cannot be in two logs" in remarks[0]


def test_databases_that_cannot_be_used(tmp_path: Path) -> None:
    later = sqlite3.connect(tmp_path / "later.sqlite")
    later.execute("PRAGMA user_version = 99")
    later.close()
    with pytest.raises(InputError, match="newer schuler"):
        FleetDatabase(tmp_path / "later.sqlite")
    other = sqlite3.connect(tmp_path / "other.sqlite")
    other.execute("CREATE TABLE customers (name TEXT)")
    other.close()
    with pytest.raises(InputError, match="something else"):
        FleetDatabase(tmp_path / "other.sqlite")
    (tmp_path / "text.sqlite").write_text("not a database at all, but long enough to be read" * 9)
    with pytest.raises(InputError, match="cannot be used"):
        FleetDatabase(tmp_path / "text.sqlite")
    with pytest.raises(InputError, match="no such"):
        FleetDatabase(tmp_path / "none.sqlite", create=False)


def test_a_table_and_a_folder(fleet: Path, tmp_path: Path) -> None:
    entries, remarks = list_logs(fleet)
    assert "s0.parquet" in {e.file.name for e in entries}
    assert "sensor of its own" in remarks[0]
    (tmp_path / "t.csv").write_text("path\na.csv\n")
    with pytest.raises(InputError, match="no column 'file'"):
        list_logs(tmp_path / "t.csv")
    (tmp_path / "t.csv").write_text("file,serial,date\na.csv,S,2026\nb.csv,S,2026\n")
    assert "one sensor cannot be in two logs" in list_logs(tmp_path / "t.csv")[1][0]
    (tmp_path / "t.csv").write_text("file,temperature\na.csv,warm\n")
    with pytest.raises(InputError, match="'warm'"):
        list_logs(tmp_path / "t.csv")
    with pytest.raises(InputError, match="twice"), FleetDatabase(tmp_path / "x.sqlite") as database:
        run_batch([LogEntry(Path("a")), LogEntry(Path("a"))], database)


def test_the_spread_between_sensors_is_told_from_their_errors() -> None:
    rng = np.random.default_rng(31)
    error = np.full(400, 0.1)
    mean, deviation, spread, p = paule_mandel(2.0 + 0.3 * rng.standard_normal(400) + 0.0, error)
    assert spread == pytest.approx(np.sqrt(0.09 - 0.01), rel=0.12)
    assert mean == pytest.approx(2.0, abs=4.0 * deviation)
    assert p < 1e-9
    alone = [paule_mandel(0.1 * rng.standard_normal(20), error[:20])[3] for _ in range(400)]
    assert np.mean(np.array(alone) < 0.05) == pytest.approx(0.05, abs=0.033)


def test_outliers_are_found_also_two_together_and_none_is_invented() -> None:
    rng = np.random.default_rng(77)
    error = np.full(20, 0.01)
    told = [bool(extreme_deviates(0.1 * rng.standard_normal(20), error, 0.01)) for _ in range(2000)]
    assert np.mean(told) < 0.022
    value = 0.1 * rng.standard_normal(20)
    value[[3, 11]] += (1.5, 1.7)
    assert {k for k, _ in extreme_deviates(value, error, 0.01)} == {3, 11}
    # what the errors explain is no outlier
    assert not extreme_deviates(value, np.full(20, 2.0), 0.01)


def test_a_sensor_that_ages_is_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        for unit in range(3):
            for year in range(6):
                value = np.exp(0.05 * year * (unit == 1) + 0.002 * rng.standard_normal())
                database.save(
                    f"{unit}{year}",
                    {
                        "file": f"{unit}{year}", "sensor": "X", "serial": f"SN{unit}",
                        "date": f"{2020 + year}-01-01", "temperature": 20.0 + year,
                        "kind": "noise", "status": "done",
                        "figures": [("gyro_x", "N", value, 0.002 * value, None)],
                    },
                )  # fmt: skip
        trends = [t for t in summarise_fleet(database).trends if t.per == "year"]
    assert [t.serial for t in trends] == ["SN1"]
    assert trends[0].slope == pytest.approx(0.05, abs=4.0 * trends[0].standard_error)


def test_a_warmer_year_is_not_ageing(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    with FleetDatabase(tmp_path / "a.sqlite") as database:
        for unit in range(6):
            for year in range(7):
                warm = 15.0 + 4.0 * year + 3.0 * rng.standard_normal()
                ageing = 0.05 * year * (unit == 2)
                value = np.exp(0.01 * (warm - 20.0) + ageing + 0.002 * rng.standard_normal())
                database.save(
                    f"{unit}{year}",
                    {
                        "file": f"{unit}{year}", "sensor": "X", "serial": f"SN{unit}",
                        "date": f"{2020 + year}-01-01", "temperature": warm,
                        "kind": "noise", "status": "done",
                        "figures": [("gyro_x", "N", value, 0.002 * value, None)],
                    },
                )  # fmt: skip
        trends = summarise_fleet(database).trends
    assert [t.serial for t in trends if t.per == "year"] == ["SN2"]
    assert next(t for t in trends if t.per == "K").slope == pytest.approx(0.01, rel=0.3)


def test_a_profile_says_how_the_logs_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = np.random.default_rng(3).normal((0, 0, 0, 0, 0, -9.8), 0.01, (3000, 6))
    head = ",".join(
        f"{s}_{a}_{u}" for s, u in (("gyro", "rad_s"), ("accel", "m_s2")) for a in "xyz"
    )
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=head, comments="")
    command = ["batch", str(tmp_path / "logs.csv"), "--out", str(tmp_path / "f.sqlite")]
    (tmp_path / "logs.csv").write_text("file\na.csv\n")
    assert run([*command, "--processes", "1"]) == 1
    assert "in a profile, which schuler read --save-profile writes" in capsys.readouterr().out
    (tmp_path / "logger.yaml").write_text("imu: {rate: 50.0}\n")
    assert run([*command, "--profile", str(tmp_path / "logger.yaml"), "--processes", "1"]) == 0
    (tmp_path / "logs.csv").write_text("file,serial,profile\na.csv,S1,logger.yaml\n")
    assert run([*command, "--processes", "1"]) == 0
    assert "1 logs done" in capsys.readouterr().out


def test_the_command_line(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    database, page, text = (tmp_path / n for n in ("f.sqlite", "f.html", "f.json"))
    command = ["batch", str(fleet / "logs.csv"), "--out", str(database), "--processes", "1"]
    assert run([*command, "--report", str(page), "--json", str(text)]) == 1  # two logs failed
    assert "6 logs done" in capsys.readouterr().out
    assert json.loads(text.read_text())["outliers"][0]["serial"] == "SN2"
    assert "SN2" in page.read_text()
    assert run([*command, "--sweep", "30"]) == 2
    assert run([*command, "--sensor", "SN2"]) == 1
    told = capsys.readouterr().out
    assert "Sensor SN2" in told
    assert "2026-01-01" in told
    assert run([*command, "--sensor", "SN77"]) == 2
