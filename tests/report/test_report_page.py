"""The page: its numbers are the results' numbers, nothing is fetched, nothing is injected."""

from __future__ import annotations

import base64
import json
import re
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_examples import circle, gnss, solution

from schuler.data.imu import ImuRecording
from schuler.errors import InputError
from schuler.report import (
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    NavigationResults,
    Prose,
    Section,
    Table,
    record_provenance,
    render_report,
    write_report,
)
from schuler.report.figures import line
from schuler.report.page import anchor, plotly_script, safe_json
from schuler.report.sections.navigation.filtering import errors_against

HOSTILE = "<script>alert('x')</script><img src=x onerror=alert(1)>\"'&{{7*7}}</title>"


class Reader(HTMLParser):
    """Collects what a browser would see."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.scripts: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        (self.scripts if self._inside == "script" else self.text).append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    return reader


def own_part(page: str) -> str:
    """The page without the source of plotly.js."""
    return page.replace(plotly_script(), "")


def figures_of(page: str) -> list[dict[str, Any]]:
    found = re.findall(r'<script type="application/json" id="figure-\d+">(.*?)</script>', page)
    return [json.loads(text) for text in found]


def numbers(encoded: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(encoded["bdata"]), dtype="<f4")


@pytest.fixture(scope="module")
def run() -> NavigationResults:
    rng = np.random.default_rng(5)
    truth = circle(6000, 100.0)
    return NavigationResults(
        solution(truth, rng),
        solution(truth, rng, sd=0.2, smoothed=True, name=HOSTILE),
        gnss(truth, 100),
        truth,
        ((1010.0, 1020.0),),
    )


@pytest.fixture(scope="module")
def page(run: NavigationResults) -> str:
    return render_report(
        run,
        title=HOSTILE,
        provenance=record_provenance(command=HOSTILE, settings={HOSTILE: HOSTILE}),
    )


def test_hostile_names_stay_text(page: str) -> None:
    reader = read(page)
    assert not [t for t, _ in reader.tags if t == "img"]
    assert HOSTILE in reader.text[reader.text.index("schuler") :]
    assert "<script>alert" not in page
    assert "49" not in [t.strip() for t in reader.text]  # no template in data is evaluated
    for tag, attributes in reader.tags:
        for name, value in attributes.items():
            assert not name.startswith("on"), (tag, name)
            assert value is None or "javascript:" not in value


def test_hostile_names_stay_text_inside_plots() -> None:
    rng = np.random.default_rng(5)
    truth = circle(600, 100.0)
    text = render_report(solution(truth, rng, name=f"gyro {HOSTILE}"))
    for figure in figures_of(text):
        assert "<script" not in json.dumps(figure)
        assert "<img" not in json.dumps(figure)


def test_nothing_is_fetched_from_anywhere(page: str) -> None:
    reader = read(page)
    for tag, attributes in reader.tags:
        for name in ("src", "href", "action", "data", "srcset", "poster"):
            value = attributes.get(name) or ""
            assert value == "" or value.startswith(("#", "data:")), (tag, value)
    policy = [a.get("content") for t, a in reader.tags if t == "meta" and "http-equiv" in a]
    assert policy
    assert "default-src 'none'" in str(policy[0])
    assert "connect-src" not in str(policy[0])
    rest = own_part(page)
    assert not re.search(r"https?://|@import|url\(|fetch\(|XMLHttpRequest", rest)
    assert page.count("plotly.js v") == 1
    assert len(page) < 7_000_000


def test_a_page_without_plots_carries_no_plotting_library() -> None:
    text = render_report(Section("Words", (Prose("nothing to plot"),)))
    assert len(text) < 60_000


def test_the_page_holds_the_numbers_it_is_given() -> None:
    table = Table("A table", ("what", "value"), (("first", "0.24123 ± 0.00083"),), note="a note")
    figure = Figure("A plot", "One line.", (line([0, 1, 2], [3.0, 1.0, 7.25], "@x", "l"),), {})
    section = Section(
        "A section",
        (
            Facts((("Rate", "100 Hz"),)),
            Findings((Finding("warning", "a knock", "At 3 s."),)),
            table,
            FigureGrid((figure,), (LegendItem("data", "@x"),), caption="below"),
        ),
        ("The sentence of the summary.",),
    )
    text = render_report(section, title="A title")
    words = " ".join(read(text).text)
    for expected in (
        "A title", "0.24123 ± 0.00083", "100 Hz", "a knock", "At 3 s.", "a note", "below", "data",
        "The sentence of the summary.", "A section",
    ):  # fmt: skip
        assert expected in words
    (drawn,) = figures_of(text)
    assert numbers(drawn["traces"][0]["y"]).tolist() == [3.0, 1.0, 7.25]
    labels = [a.get("aria-label") for t, a in read(text).tags if a.get("role") == "img"]
    assert labels == ["A plot. One line."]


def test_real_errors_against_claims_are_those_of_the_run(page: str) -> None:
    rows = [" ".join(r.split()) for r in re.findall(r"<tr.*?</tr>", page, flags=re.S)]
    cells = [re.sub(r"<[^>]+>", " ", r).split() for r in rows]
    position = [c for c in cells if "position" in c and ("causal" in c or "smoothed" in c)]
    # 6000 samples of 0.5 m and 0.2 m: the rms is known to 1 %; 95.4 % of a Gaussian is in 2 sigma.
    assert [float(v) for v in position[0][2:8:2]] == pytest.approx([0.5] * 3, rel=0.04)
    assert [float(v) for v in position[1][2:8:2]] == pytest.approx([0.2] * 3, rel=0.04)
    assert float(position[0][8]) == pytest.approx(95.4, abs=1.5)


def test_error_signs_are_computed_minus_true() -> None:
    truth = circle(50, 10.0)
    rng = np.random.default_rng(0)
    exact = solution(truth, rng, sd=1e-12)
    shifted = np.array(truth.position)
    shifted[:, 0] += 3.0 / 6.3730e6  # 3 m to the north (meridian radius at 0.8 rad, 300 m)
    shifted[:, 2] += 2.0
    psi = np.array([1e-3, -2e-3, 3e-3])
    cross = np.array([[0, -psi[2], psi[1]], [psi[2], 0, -psi[0]], [-psi[1], psi[0], 0]])
    from dataclasses import replace

    moved = replace(
        exact,
        trajectory=replace(
            exact.trajectory,
            position=shifted,
            velocity=truth.velocity + np.array([0.1, 0.0, 0.0]),
            rotation=np.einsum("ij,njk->nik", np.eye(3) - cross, truth.rotation),
        ),
    )
    errors = errors_against(truth, moved)
    np.testing.assert_allclose(errors["position"], np.tile([3.0, 0, -2.0], (50, 1)), atol=5e-3)
    np.testing.assert_allclose(errors["velocity"], np.tile([0.1, 0, 0], (50, 1)), atol=1e-12)
    np.testing.assert_allclose(errors["attitude"], np.tile(psi, (50, 1)), atol=1e-9)


def test_the_track_is_drawn_east_against_north_to_one_scale(page: str) -> None:
    drawn = next(
        f for f in figures_of(page) if f["layout"]["xaxis"]["title"]["text"] == "east in m"
    )
    assert drawn["layout"]["yaxis"]["scaleanchor"] == "x"
    truth = next(t for t in drawn["traces"] if t["name"] == "truth")
    north, east = numbers(truth["y"]), numbers(truth["x"])
    # Sixty seconds at 10 m/s on a circle of 200 m to the right of a start to the north.
    assert np.hypot(north, east - 200.0) == pytest.approx(np.full(north.size, 200.0), abs=2.0)
    assert east[north.size // 4] > 5.0
    lost = [t for t in drawn["traces"] if "without GNSS" in t["name"]]
    assert len(lost) == 1
    length = np.hypot(np.diff(numbers(lost[0]["x"])), np.diff(numbers(lost[0]["y"]))).sum()
    assert length >= 95.0


def test_recordings_show_their_largest_value_in_their_unit() -> None:
    n = 200_000
    rng = np.random.default_rng(2)
    gyro = 1e-3 * rng.standard_normal((n, 3))
    gyro[123_456, 1] = np.radians(17.4)
    accel = np.full((n, 3), np.nan)
    accel[:, 2] = -9.8
    imu = ImuRecording(np.arange(n) / 100.0, gyro, accel, name=HOSTILE)
    text = render_report(imu)
    drawn = figures_of(text)
    assert len(drawn) == 4  # two accelerometers were not recorded
    highest = max(numbers(trace["y"]).max() for trace in drawn[1]["traces"])
    lowest = min(numbers(trace["y"]).min() for trace in drawn[0]["traces"])
    assert highest == pytest.approx(17.4, rel=1e-6)
    assert lowest == pytest.approx(np.degrees(gyro[:, 0].min()), rel=1e-6)
    assert len(text) - len(plotly_script()) < 300_000


def test_json_for_pages_cannot_leave_its_script_or_hold_nan() -> None:
    assert json.loads(safe_json({"a": "</script><!--\u2028"})) == {"a": "</script><!--\u2028"}
    assert "<" not in safe_json("</script>")
    with pytest.raises(ValueError, match=r"[Nn]a[Nn]|JSON"):
        safe_json(float("nan"))


def test_anchors_are_plain() -> None:
    assert anchor("Errors & <truth>") == "errors-truth"
    assert anchor("§§") == "section"


def test_the_file_is_complete_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "report.html"
    target.write_text("old")
    with pytest.raises(InputError, match="cannot show"):
        write_report(target, object())
    assert target.read_text() == "old"

    def fails(self: Path, *args: object, **kwargs: object) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", fails)
        with pytest.raises(InputError, match="No space"):
            write_report(target, Section("S", ()))
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    with pytest.raises(InputError, match="cannot write there"):
        write_report(tmp_path / "missing" / "r.html", Section("S", ()))
    write_report(target, Section("S", ()))
    assert target.read_text().startswith("<!DOCTYPE html>")


def test_provenance_names_every_input_by_its_digest(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_bytes(b"abc")
    record = record_provenance(inputs=[file], seeds={"drive": 7})
    assert record.inputs[0].sha256.startswith("ba7816bf8f01cfea")  # FIPS 180-2, example "abc"
    words = " ".join(read(render_report(Section("S", ()), provenance=record)).text)
    assert "ba7816bf8f01cfea" in words
    assert "log.csv" in words
    assert "Seed of drive" in words
    folder = record_provenance(inputs=[tmp_path])
    assert [f.name for f in folder.inputs] == ["log.csv"]
    with pytest.raises(InputError, match="cannot be read"):
        record_provenance(inputs=[tmp_path / "none"])


def test_all_parts_of_the_page_are_under_version_control() -> None:
    root = Path(__file__).resolve().parents[2]
    assets = root / "src" / "schuler" / "report" / "assets"
    if not (root / ".git").exists():
        pytest.skip("not a clone")
    for part in assets.iterdir():
        ignored = subprocess.run(["git", "check-ignore", "-q", str(part)], cwd=root, check=False)
        assert ignored.returncode == 1, part.name
