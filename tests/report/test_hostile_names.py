"""Names of strangers stand in many places; in HTML and in spreadsheets they stay names."""

from html.parser import HTMLParser

import numpy as np
import pytest

import schuler
from schuler import GaussMarkov, GnssRecording, ImuRecording, NoiseModel, WhiteNoise
from schuler.io.trajectory import write_columns
from schuler.report import render_report

HOSTILE = "</script><script>evil()</script><img src=x onerror=evil()>\"'{{7*7}}"


class Elements(HTMLParser):
    """Names of elements and of attributes that run something."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attributes):
        self.found.append(tag)
        assert not any(
            "evil" in (value or "") and name.startswith("on") for name, value in attributes
        )


def harmless(page, scripts):
    elements = Elements()
    elements.feed(page)
    assert "img" not in elements.found
    assert elements.found.count("script") == scripts
    assert "evil" in page  # it stands there, as text


def recording(n=400):
    rng = np.random.default_rng(2)
    time = np.arange(n) / 100.0
    gyro, accel = 1e-3 * rng.normal(size=(n, 3)), 1e-2 * rng.normal(size=(n, 3))
    accel[:, 2] -= 9.81
    return ImuRecording(
        time, gyro, accel, name=HOSTILE, history=(HOSTILE,), assumptions=(f"gyro as {HOSTILE}",)
    )


def model():
    return NoiseModel(
        {"gyro_x": WhiteNoise(1e-3) + GaussMarkov(1e-3, 5.0)}, rate=100.0, source=HOSTILE
    )


RESULTS = {
    "recording": recording,
    "screening": lambda: schuler.screen(recording()),
    "noise model": model,
    "gnss": lambda: GnssRecording(
        np.arange(4.0), np.full((4, 3), 0.5), name=HOSTILE, history=(HOSTILE,)
    ),
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_name_is_text_in_notebooks(name):
    result = RESULTS[name]()
    show = getattr(result, "_repr_html_", None)
    if show is None:
        pytest.skip("it has no HTML")
    page = show()
    elements = Elements()
    elements.feed(page)
    assert not {"img", "script"} & set(elements.found)


@pytest.mark.parametrize("name", ["recording", "screening"])
def test_a_name_is_text_in_reports(name):
    page = render_report(RESULTS[name](), title=HOSTILE)
    plain = render_report(RESULTS[name](), title="evil")
    count = Elements()
    count.feed(plain)
    harmless(page, count.found.count("script"))


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r"])
def test_cells_that_a_spreadsheet_would_run_are_quoted(tmp_path, start):
    wild = f"{start}cmd|'/C calc'!A0"
    columns = {"time_s": np.arange(2.0), wild: np.array([-1.5, 2.0]), "text": np.array([wild, "x"])}
    path = tmp_path / "a.csv"
    write_columns(path, columns)
    lines = path.read_text(encoding="utf-8").replace("\r", "").splitlines()
    cells = [cell.strip('"') for line in lines for cell in line.split(",")]
    assert not any(cell.startswith(start) and "cmd" in cell for cell in cells)
    assert "-1.5" in cells  # numbers stay numbers
