"""Numbers do not depend on how many threads linear algebra takes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import threads_work

ROOT = Path(__file__).parents[2]


@pytest.mark.filterwarnings("ignore")
def test_the_same_numbers_with_two_threads(capsys: pytest.CaptureFixture[str]) -> None:
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        pytest.skip("this process takes all threads itself")
    threads_work.main()
    here = capsys.readouterr().out
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "2", "PYTHONPATH": str(ROOT / "src")}
    there = subprocess.run(
        [sys.executable, str(Path(threads_work.__file__))],
        env=environment, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    assert here == there.stdout
    assert "covariance" in here
