"""Archives are looked at before they are unpacked."""

import tracemalloc
import zipfile

import numpy as np
import pytest

from schuler import InputError, read_imu


def test_an_archive_that_would_fill_the_memory_is_refused_before_unpacking(tmp_path):
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, time=np.zeros(25_000_000))
    tracemalloc.start()
    with pytest.raises(InputError, match="would unpack to 200 MB"):
        read_imu(path)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()


@pytest.mark.parametrize(
    "array",
    [np.zeros(4, "V8"), np.zeros(4, [("a", "f8")]), np.array([b"1", b"2"]), np.zeros(4, complex)],
)
def test_arrays_that_are_no_numbers_are_refused_by_name(tmp_path, array):
    path = tmp_path / "x.npz"
    np.savez(path, time=np.arange(4.0), gyro=array)
    with pytest.raises(InputError, match=r"'gyro' holds no numbers"):
        read_imu(path)


def test_a_member_that_is_no_array_is_refused(tmp_path):
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("../../evil.txt", "hello")
    with pytest.raises(InputError, match=r"ZIP archive|holds no numbers"):
        read_imu(path)
    assert not (tmp_path.parent.parent / "evil.txt").exists()
