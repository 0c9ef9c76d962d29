"""The window answers its own page on this machine alone, and shows nothing outside its folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("httpx2")
from starlette.testclient import TestClient

from schuler.errors import InputError
from schuler.view.app import application
from schuler.view.folder import RESULTS, Folder
from schuler.view.jobs import Jobs
from schuler.view.server import _socket

TOKEN, PORT = "a-secret", 8123
ORIGIN = f"http://127.0.0.1:{PORT}"


def client_of(folder: Path) -> TestClient:
    shown = Folder(folder)
    return TestClient(application(shown, Jobs(shown), TOKEN, PORT), base_url=ORIGIN)


@pytest.fixture
def stranger(shown_folder: Path) -> TestClient:
    return client_of(shown_folder)


@pytest.fixture
def friend(stranger: TestClient) -> Iterator[TestClient]:
    assert stranger.get("/", params={"token": TOKEN}).status_code == 200
    yield stranger


PLACES = ("/", "/api/files", "/api/jobs", "/page?file=page.html", "/assets/plotly.js", "/nothing")


@pytest.mark.parametrize("place", PLACES)
def test_nothing_without_the_token(stranger: TestClient, place: str) -> None:
    assert stranger.get(place).status_code == 403
    assert stranger.get(place, headers={"cookie": f"schuler-view-{PORT}=x"}).status_code == 403


@pytest.mark.parametrize("token", ["", "a-secre", "a-secret2", "ä"])
def test_a_wrong_token_opens_nothing(stranger: TestClient, token: str) -> None:
    answer = stranger.get("/", params={"token": token})
    assert answer.status_code == 403
    assert "set-cookie" not in answer.headers


def test_the_token_leaves_the_address(stranger: TestClient) -> None:
    answer = stranger.get("/", params={"token": TOKEN}, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost.evil:8123", ""]
)
def test_other_names_of_this_machine_are_refused(friend: TestClient, host: str) -> None:
    assert friend.get("/api/files", headers={"host": host}).status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:8123", "http://127.0.0.1:1"]
)
def test_other_pages_are_refused(friend: TestClient, origin: str) -> None:
    wanted = {"verb": "compare", "results": []}
    assert friend.post("/api/jobs", json=wanted, headers={"origin": origin}).status_code == 403
    assert friend.get("/api/files", headers={"origin": origin}).status_code == 403
    assert friend.post("/api/jobs", json=wanted).status_code == 403  # a request without origin
    assert friend.post("/api/jobs", json=wanted, headers={"origin": ORIGIN}).status_code == 400


OUTSIDE = ("../secret.html", "link.html", "up/secret.html", "..%2fsecret.html",
           "%2e%2e/secret.html", "/etc/passwd", "page.html/../../secret.html",
           "..\\secret.html", ".hidden.html", "a\0b",
           "", "//page.html", "./page.html", "C:/x.html", "imu.parquet")  # fmt: skip


@pytest.mark.parametrize("name", OUTSIDE)
def test_no_page_outside_the_folder(friend: TestClient, name: str) -> None:
    answer = friend.get("/page", params={"file": name})
    assert answer.status_code == 400
    assert "secret" not in answer.text.replace(name, "")
    assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize("name", ["../secret.html", "up/imu.parquet", "up"])
def test_no_recording_or_job_outside_the_folder(friend: TestClient, name: str) -> None:
    asked: list[dict[str, Any]] = [
        {"verb": "characterize", "imu": name},
        {"verb": "navigate", "imu": name, "gnss": "gnss.parquet"},
        {"verb": "navigate", "imu": "imu.parquet", "gnss": "gnss.parquet", "noise": name},
        {"verb": "compare", "results": [name, name]},
        {"verb": "navigate", "imu": "imu.parquet", "gnss": "gnss.parquet", "windows": "--out=x"},
        {"verb": "characterize", "imu": "imu.parquet", "gyro_unit": "x --out=y"},
        {"verb": "run"},
        {},
    ]
    assert friend.get("/api/recording", params={"file": name}).status_code == 400
    for wanted in asked:
        answer = friend.post("/api/jobs", json=wanted, headers={"origin": ORIGIN})
        assert answer.status_code == 400, wanted
    assert friend.get("/api/jobs").json() == []


def test_results_do_not_follow_a_link_out(shown_folder: Path, tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / RESULTS).symlink_to(tmp_path)
    with pytest.raises(InputError, match=RESULTS):
        Folder(inner).results("navigate")


def test_pages_of_the_folder_are_locked_in(friend: TestClient) -> None:
    policy = friend.get("/page", params={"file": "page.html"}).headers["content-security-policy"]
    assert policy.startswith("sandbox allow-scripts allow-downloads; default-src 'none'")
    assert "same-origin" not in policy
    ours = friend.get("/").headers["content-security-policy"]
    assert "script-src 'self';" in ours
    assert "frame-ancestors 'none'" in ours


def test_the_list_holds_the_folder_alone(friend: TestClient, shown_folder: Path) -> None:
    found = friend.get("/api/files").json()
    assert found["pages"] == ["page.html"]
    assert {"imu.parquet", "gnss.parquet", "static.parquet"} <= set(found["recordings"])


def test_a_port_in_use_is_one_line() -> None:
    with _socket(0) as first:
        with pytest.raises(InputError, match="is in use; name another"):
            _socket(first.getsockname()[1])
        assert first.getsockname()[0] == "127.0.0.1"
