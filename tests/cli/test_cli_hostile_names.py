"""Names of folders, files, columns and units of strangers stay text in a report."""

from html.parser import HTMLParser

import numpy as np
import pytest


class Elements(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag, attributes):
        self.found.append(tag)


@pytest.mark.skipif(__import__("os").name == "nt", reason="such names cannot exist there")
def test_hostile_names_of_columns_units_and_files_stay_text(tmp_path, call):
    folder = tmp_path / "a <img src=x onerror=evil()>"
    folder.mkdir()
    path = folder / "<b onmouseover=evil()>.csv"
    rng = np.random.default_rng(5)
    head = "time [s]," + ",".join(f"gyro_{a} [rad/s],accel_{a} [m/s^2]" for a in "xyz")
    rows = [",".join(f"{v:.6g}" for v in (k / 100, *rng.normal(size=6))) for k in range(300)]
    path.write_text(
        "\n".join([f"{head},<img src=x onerror=evil()> [<script>evil()</script>]"]
                  + [f"{r},1" for r in rows]) + "\n"
    )  # fmt: skip
    done = call("characterize", path, "--report", tmp_path / "page.html")
    assert done.code in (0, 1), done.err
    elements = Elements()
    elements.feed((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert not {"img", "b"} & set(elements.found)
