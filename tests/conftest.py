"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of real recordings: SCHULER_DATA, or shared/data beside the repository.

    Where it is missing the tests are skipped, but in CI they must run.
    """
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("SCHULER_DATA", beside))
    if not (folder / "rtk-drive" / "imu.parquet").is_file():
        text = f"no recordings in {folder} (set SCHULER_DATA)"
        if os.environ.get("CI"):
            pytest.fail(text)
        pytest.skip(text)
    return folder
