"""A folder of small recordings, with what must not be reached beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler.noise import NoiseModel, WhiteNoise
from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu, simulate_static

HOSTILE = "<img src=x onerror=alert(1)>.csv"


@pytest.fixture(scope="session")
def shown_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    outside = tmp_path_factory.mktemp("outside")
    folder = outside / "shown"
    folder.mkdir()
    (outside / "secret.html").write_text("secret")
    (folder / "link.html").symlink_to(outside / "secret.html")
    (folder / "up").symlink_to(outside)
    (folder / ".hidden.html").write_text("secret")
    (folder / HOSTILE).write_text("not a recording")
    (folder / "page.html").write_text("<h1 id=h>A page</h1><script>h.id='ran'</script>")
    noise = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    rng = np.random.default_rng(3)
    simulate_static(noise, 120.0, 50.0, rng).to_parquet(folder / "static.parquet")
    profile = car_urban(90.0, np.random.default_rng(12), standstill=20.0)
    simulate_imu(ideal_imu(profile, 50.0), noise, rng).to_parquet(folder / "imu.parquet")
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    gnss.to_parquet(folder / "gnss.parquet")
    return folder
