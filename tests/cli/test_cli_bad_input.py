"""Bad input: exit code 2, one clear line, nothing written."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars
import pytest
from outcome import Outcome

HEADER = "time_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2"


def rows(n: int = 2000) -> list[str]:
    rng = np.random.default_rng(4)
    values = np.column_stack(
        [np.arange(n) / 100.0, 1e-3 * rng.standard_normal((n, 6)) + [0, 0, 0, 0, 0, -9.8]]
    )
    return [HEADER, *(",".join(f"{v:.6f}" for v in row) for row in values)]


def changed(line: int, column: int, text: str) -> str:
    lines = rows()
    cells = lines[line].split(",")
    cells[column] = text
    lines[line] = ",".join(cells)
    return "\n".join(lines) + "\n"


def without_column(column: int) -> str:
    cut = (line.split(",") for line in rows())
    return "\n".join(",".join(c for k, c in enumerate(cells) if k != column) for cells in cut)


def zero_axis() -> str:
    cut = [line.split(",") for line in rows()]
    for cells in cut[1:]:
        cells[2] = "0.0"
    return "\n".join(",".join(cells) for cells in cut) + "\n"


BAD_LOGS = {
    "empty": ("", "empty"),
    "only a header": (HEADER + "\n", ""),
    "no sensor column": ("\n".join(r.split(",", 1)[0] for r in rows()) + "\n", "gyro"),
    "text in a number": (changed(700, 3, "abc"), "abc"),
    "time goes backwards": (changed(900, 0, "1.000000"), "backwards"),
    "time repeats": (changed(900, 0, "8.980000"), "repeat"),
    "NaN": (changed(500, 4, "nan"), "NaN"),
    "one sample": ("\n".join(rows(1)) + "\n", "1 sample"),
    "two samples": ("\n".join(rows(2)) + "\n", ""),
    "no rate": ("\n".join(r.split(",", 1)[1] for r in rows()) + "\n", "rate"),
    "an axis of zeros": (zero_axis(), "gyro_y"),
    "cut in a line": ("\n".join(rows())[:-23], "cut"),
    "not text at all": ("\x00\x01\x02\xff" * 100, ""),
}


@pytest.mark.parametrize("name", BAD_LOGS)
def test_bad_logs(name: str, tmp_path: Path, call: Callable[..., Outcome]) -> None:
    content, word = BAD_LOGS[name]
    log = tmp_path / "log.csv"
    log.write_text(content, encoding="latin-1")
    targets = [tmp_path / n for n in ("r.html", "r.json", "n.yaml", "k.yaml")]
    options = zip(("--report", "--json", "--noise-out", "--kalibr"), targets, strict=True)
    outcome = call("characterize", log, *(part for pair in options for part in pair))
    line = outcome.one_line()
    assert outcome.code == 2, line
    assert "log.csv" in line
    assert word.lower() in line.lower()
    assert "bug" not in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv"]
    assert outcome.out == ""


def test_a_drive_needs_every_column(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    log = tmp_path / "log.csv"
    log.write_text(without_column(6))
    outcome = call("navigate", "--imu", log, "--gnss", recordings / "gnss.parquet")
    line = outcome.one_line()
    assert outcome.code == 2, line
    assert "accel_z" in line


def drive_with(recordings: Path, folder: Path, change: Callable[..., polars.DataFrame]) -> Path:
    change(polars.read_parquet(recordings / "gnss.parquet")).write_parquet(folder / "gnss.parquet")
    return folder / "gnss.parquet"


BAD_GNSS = {
    "no overlap": (lambda f: f.with_columns(polars.col("time_s") + 1e5), "overlap"),
    "zero deviations": (
        lambda f: f.with_columns(polars.lit(0.0).alias("pos_std_north_m")),
        "--gnss-position-sd",
    ),
    "no deviations": (lambda f: f.drop([c for c in f.columns if "std" in c]), "--gnss-position-sd"),
}


@pytest.mark.parametrize("name", BAD_GNSS)
@pytest.mark.parametrize("verb", ["navigate", "outages"])
def test_bad_gnss(
    name: str, verb: str, recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    change, word = BAD_GNSS[name]
    gnss = drive_with(recordings, tmp_path, change)
    more = ["--window", "60:10"] if verb == "outages" else ["--out", tmp_path / "t.csv"]
    report = tmp_path / "r.html"
    outcome = call(
        verb, "--imu", recordings / "imu.parquet", "--gnss", gnss, "--report", report, *more
    )
    line = outcome.one_line()
    assert outcome.code == 2, line
    assert word in line
    assert "gnss.parquet" in line
    assert [p.name for p in tmp_path.iterdir()] == ["gnss.parquet"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["characterise"], "Did you mean 'characterize'"),
        (["characterize"], "FILE"),
        (["characterize", "nowhere.csv"], "nowhere.csv"),
        (["characterize", "{static}", "--repot", "x.html"], "--repot"),
        (["characterize", "{static}", "--report", "no/such/folder/r.html"], "folder"),
        (["characterize", "{static}", "--report", "{folder}"], "is a folder"),
        (["characterize", "{static}", "--json", "{static}"], "is also an input"),
        (["characterize", "{static}", "--json", "{folder}/a", "--report", "{folder}/a"], "two"),
        (["characterize", "{static}", "--rate", "fast"], "fast"),
        (["characterize", "{static}", "--column", "gyro_x"], "ROLE=NAME"),
        (["characterize", "{static}", "--column", "gyro_x=none"], "none"),
        (["characterize", "{static}", "--gyro-unit", "furlong"], "furlong"),
        (["navigate", "--imu", "{imu}"], "--gnss"),
        (["navigate", "--imu", "{imu}", "--gnss", "{gnss}", "--lever-arm", "1,2"], "1,2"),
        (["navigate", "--imu", "{imu}", "--gnss", "{gnss}", "--lever-arm", "1,2,nan"], "nan"),
        (["navigate", "--imu", "{imu}", "--gnss", "{gnss}", "--out", "t.xls"], ".xls"),
        (["navigate", "--imu", "{imu}", "--gnss", "{gnss}", "--noise", "none.yaml"], "none.yaml"),
        (["outages", "--imu", "{imu}", "--gnss", "{gnss}"], "--window"),
        (["outages", "--imu", "{imu}", "--gnss", "{gnss}", "--window", "60"], "START:SECONDS"),
        (["outages", "--imu", "{imu}", "--gnss", "{gnss}", "--window", "60:-5"], "60:-5"),
        (["outages", "--imu", "{imu}", "--gnss", "{gnss}", "--sweep", "0:10"], "0:10"),
        (
            ["outages", "--imu", "{imu}", "--gnss", "{gnss}", "--sweep", "9:9", "--window", "1:1"],
            "together",
        ),
        (["export", "{noise}", "out.yaml", "--to", "csv"], "csv"),
        (["export", "{imu}", "out.csv", "--to", "csv"], "height_m"),
        (["export", "{noise}", "{noise}"], "is also an input"),
        (["export", "none.yaml", "out.yaml"], "none.yaml"),
        (["demo", "--data", "no-such-folder"], "no-such-folder"),
        (["demo", "--data", "{empty}"], "no recordings found"),
        (["demo", "--out", "{noise}"], "is a file"),
    ],
)
def test_wrong_command_lines(
    arguments: list[str],
    words: str,
    recordings: Path,
    tmp_path: Path,
    call: Callable[..., Outcome],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    empty = tmp_path / "empty"
    empty.mkdir()
    places = {name: recordings / f"{name}.parquet" for name in ("static", "imu", "gnss")}
    places |= {"folder": recordings, "noise": recordings / "noise.yaml", "empty": empty}
    before = sorted(recordings.iterdir())
    outcome = call(*(a.format(**places) for a in arguments))
    line = outcome.one_line()
    assert outcome.code == 2, line
    assert words in line
    assert outcome.out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["empty"]
    assert sorted(recordings.iterdir()) == before


def test_the_installed_program_speaks_like_the_function(tmp_path: Path) -> None:
    log = tmp_path / "evil\x1b[31m.csv"
    log.write_text(HEADER + "\n0,1,2,x\x1b]0;owned\x07,4,5,6\n")
    done = subprocess.run(
        [sys.executable, "-m", "schuler", "characterize", str(log)],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert "\x1b" not in done.stderr
    assert "\x07" not in done.stderr


def test_an_interrupt_ends_quietly(
    recordings: Path, call: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("schuler.io.read_imu", interrupted)
    outcome = call("characterize", recordings / "static.parquet")
    assert outcome.code == 130
    assert "interrupted" in outcome.one_line()


def test_a_bug_is_called_a_bug(
    recordings: Path, call: Callable[..., Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError("one over nothing")

    monkeypatch.delenv("SCHULER_DEBUG", raising=False)
    monkeypatch.setattr("schuler.io.read_imu", broken)
    outcome = call("characterize", recordings / "static.parquet")
    assert outcome.code == 70
    assert "bug" in outcome.one_line()
    monkeypatch.setenv("SCHULER_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        call("characterize", recordings / "static.parquet")


def test_outputs_appear_together_or_not_at_all(tmp_path: Path) -> None:
    from schuler.cli.outputs import Outputs
    from schuler.errors import InputError

    first, second = tmp_path / "first", tmp_path / "second"
    outputs = Outputs(first, second)
    outputs.text(first, lambda: "1")

    def fails(path: Path) -> None:
        raise OSError(28, "No space left on device")

    outputs.file(second, fails)
    with pytest.raises(InputError, match="No space"):
        outputs.commit()
    assert list(tmp_path.iterdir()) == []
