"""YAML of users is read with limits: nothing in it can hang, exhaust or surprise."""

import time

import pytest

from schuler import ArrayCalibration, ImuCalibration, InputError, NoiseModel, SchulerError
from schuler.data.mounting import read_mounting
from schuler.data.yaml_file import read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n"
    for a, b in zip("abcdefghijk", "bcdefghijkl", strict=True)
)
REFUSED = (
    (BOMB, "more than 200000 entries"),
    ("a: &a [*a]\n", "more than 200000 entries"),
    ("[" * 3000, "deep"),
    ("a: " + "9" * 5000, "number of 5000"),
    ("a: 1." + "9" * 400, "number of 402"),
    ("a: 1\nb: 2\na: 3\n", "'a' stands twice"),
    ("a: !!set {x}\n", "a tag"),
    ("a: !!python/object/apply:os.getcwd []\n", "a tag"),
    ("? [1, 2]\n: 3\n", "no single word"),
    ("a: [", "not YAML"),
    ("a: *b", "undefined alias"),
    ("a: \x07", "not YAML"),
    ("a: 1\n---\nb: 2\n", "document"),
)


@pytest.mark.parametrize(("text", "why"), REFUSED)
def test_what_could_hang_or_surprise_is_refused_at_once(tmp_path, text, why):
    path = tmp_path / "x.yaml"
    path.write_text(text)
    started = time.process_time()
    with pytest.raises(InputError, match=why):
        read_yaml(path, "anything")
    assert time.process_time() - started < 5.0


def test_large_binary_and_missing_files_are_refused(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_bytes(b"a" * (2 << 20))
    with pytest.raises(InputError, match="1 MiB"):
        read_yaml(path, "anything")
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not text"):
        read_yaml(path, "anything")
    with pytest.raises(InputError, match="cannot be read"):
        read_yaml(tmp_path / "none.yaml", "anything")


def test_plain_yaml_with_an_anchor_is_read_and_dates_stay_text(tmp_path):
    path = tmp_path / "x.yaml"
    path.write_text("a: &x {n: 1.5e-3, k: -7}\nb: *x\nc: 2024-13-45\nd: 1_000\ne: 12:30\nf: no\n")
    assert read_yaml(path, "anything") == {
        "a": {"n": 1.5e-3, "k": -7}, "b": {"n": 1.5e-3, "k": -7}, "c": "2024-13-45",
        "d": "1_000", "e": "12:30", "f": False,
    }  # fmt: skip


@pytest.mark.parametrize(
    "load", [NoiseModel.load, ArrayCalibration.load, ImuCalibration.load, read_mounting]
)
def test_every_file_of_ours_is_read_with_the_limits(tmp_path, load):
    path = tmp_path / "x.yaml"
    path.write_text(BOMB)
    with pytest.raises(InputError, match="more than 200000 entries"):
        load(path)


@pytest.mark.parametrize(
    "value", ["1_000", "١٢", "'١٢ deg/sqrt(h)'", "0x10", "1e400", ".inf", "2024-01-01", "yes"]
)
def test_a_number_of_a_noise_model_is_plain_digits(tmp_path, value):
    path = tmp_path / "x.yaml"
    path.write_text(f"channels:\n  gyro_x:\n    - white_noise: {{density: {value}}}\n")
    with pytest.raises(SchulerError):
        NoiseModel.load(path)


def test_a_zero_in_front_makes_no_octal_number(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("rate: 0100\nserial: 055816394\n", encoding="utf-8")
    assert read_yaml(path, "plain YAML") == {"rate": 100, "serial": 55816394}
