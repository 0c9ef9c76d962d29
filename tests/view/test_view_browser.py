"""A person clicks through the window: pick, zoom, take GNSS away, navigate, compare."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from headless import CHROMIUM, Page

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytestmark = pytest.mark.skipif(
    CHROMIUM is None or os.name == "nt", reason="needs Chromium and its pipe"
)


@pytest.fixture
def address(shown_folder: Path, tmp_path: Path) -> Iterator[str]:
    folder = tmp_path / "shown"
    shutil.copytree(shown_folder, folder, symlinks=True)
    command = [sys.executable, "-m", "schuler", "view", str(folder), "--no-browser"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    yield child.stdout.readline().strip()
    child.send_signal(signal.SIGINT)
    assert child.wait(20) == 0


def click(page: Page, name: str) -> None:
    page.see(
        "[...document.querySelectorAll('aside button')]"
        f".find(b => b.dataset.name === {json.dumps(name)}).click()"
    )


def test_a_person_clicks_through(address: str, tmp_path: Path) -> None:
    with Page(tmp_path / "profile", address) as page:
        assert page.until("location.pathname + location.search") == "/"
        page.until("document.querySelectorAll('#recordings button').length == 4")
        assert page.see("document.querySelectorAll('img').length") == 0  # a name stays a name
        click(page, "imu.parquet")
        page.until("document.querySelectorAll('#plot .scatterlayer .trace').length == 6")
        page.see("Plotly.relayout('plot', {'xaxis.range[0]': 40, 'xaxis.range[1]': 55}); 0")
        page.until("document.getElementById('plot').layout.xaxis.range[0] === 40")
        page.see("document.getElementById('outage').click()")
        assert page.until("document.getElementById('windows').value").endswith(":15.0")
        for _ in range(2):
            page.see("document.getElementById('navigate').click()")
        page.until("document.querySelectorAll('#jobs .done').length == 2", 240.0)
        page.see("document.querySelector('#jobs button').click()")
        assert page.until("document.getElementById('page').src").endswith(".html")
        page.until("document.querySelectorAll('#numbers input').length == 2")
        page.see("document.querySelectorAll('#numbers input').forEach(box => box.click())")
        page.see("document.getElementById('compare').click()")
        page.until("document.querySelectorAll('#jobs .done').length == 3", 60.0)
        click(page, "page.html")  # runs its scripts, and cannot see the window around it
        page.until("document.getElementById('page').contentDocument === null")
        click(page, "<img src=x onerror=alert(1)>.csv")
        assert "<img" in page.until("document.getElementById('error').textContent")
        assert [e for e in page.errors if "400" not in e] == []
