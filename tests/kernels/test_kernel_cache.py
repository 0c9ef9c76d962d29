"""Compiled kernels on disk: damaged or foreign ones are compiled again, with one line."""

import os
import sys
import warnings

import numba
import pytest

from schuler.kernels import cache
from schuler.kernels.cache import KernelCache, usable_folder

posix = pytest.mark.skipif(os.name != "posix", reason="owners and modes of Unix")


def double(x):
    return 2.0 * x


def kept(folder):
    """Return a fresh dispatcher of a kernel that is kept in a folder, after one call."""
    compiled = numba.njit(double)
    compiled._cache = KernelCache(double, folder)
    assert compiled(1.5) == 3.0
    return sum(compiled.stats.cache_hits.values()) == 1


@pytest.fixture
def folder(tmp_path):
    cache._say.cache_clear()
    folder = tmp_path / "kernels"
    folder.mkdir(mode=0o700)
    assert not kept(folder)
    assert kept(folder)
    return folder


def cut(path):
    path.write_bytes(path.read_bytes()[:100])


def flip(path):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)


def link(path):
    path.rename(path.with_suffix(".other"))
    path.symlink_to(path.with_suffix(".other"))


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "cut short": cut,
    "one bit": flip,
    "random": lambda path: path.write_bytes(os.urandom(5000)),
    "no pickle": lambda path: path.write_bytes(__import__("hashlib").sha256(b"x").digest() + b"x"),
    "writable to all": lambda path: path.chmod(0o666),
    "of another user": lambda path: os.chown(path, 12345, 12345),
    "a link": link,
}


@posix
@pytest.mark.parametrize("how", DAMAGE)
def test_what_cannot_be_trusted_is_compiled_again_once_with_one_line(folder, how):
    if how == "of another user" and os.getuid() != 0:
        pytest.skip("only root can give files away")
    (path,) = folder.iterdir()
    DAMAGE[how](path)
    with pytest.warns(RuntimeWarning, match=r"kernels: .*compiled anew") as told:
        assert not kept(folder)
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert kept(folder)


@posix
def test_nothing_of_another_users_file_is_unpickled(folder, monkeypatch):
    (path,) = folder.iterdir()
    path.chmod(0o620)
    monkeypatch.setattr(cache.pickle, "loads", lambda data: pytest.fail("it was unpickled"))
    with pytest.warns(RuntimeWarning):
        assert not kept(folder)


@posix
@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_a_folder_that_others_can_write_is_gone_around(tmp_path, monkeypatch, mode):
    cache._say.cache_clear()
    monkeypatch.setenv("SCHULER_CACHE_DIR", str(tmp_path / "own"))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    (tmp_path / "own" / "k").mkdir(parents=True)
    (tmp_path / "own" / "k").chmod(mode)
    with pytest.warns(RuntimeWarning, match="written by another user; compiled kernels are kept"):
        found = usable_folder("k")
    assert found == tmp_path / f"schuler-{os.getuid()}" / "k"
    assert found.stat().st_mode & 0o777 == 0o700
    found.chmod(0o777)
    with pytest.warns(RuntimeWarning, match="compiled anew in every run"):
        assert usable_folder("k") is None


def test_a_folder_that_cannot_be_made_is_gone_around(tmp_path, monkeypatch):
    cache._say.cache_clear()
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("SCHULER_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    with pytest.warns(RuntimeWarning, match="cannot be used"):
        assert usable_folder("k") is not None


def test_code_that_cannot_be_kept_is_used_all_the_same(tmp_path):
    cache._say.cache_clear()
    with pytest.warns(RuntimeWarning, match="cannot be kept"):
        assert not kept(tmp_path / "none")


@pytest.mark.skipif(sys.platform == "win32", reason="the home folder of Unix")
def test_a_user_without_name_and_home_has_a_cache_all_the_same(tmp_path, monkeypatch):
    """As in containers that run under a number of their own."""
    cache._say.cache_clear()
    for name in ("HOME", "SCHULER_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os, "getuid", lambda: 54321)
    monkeypatch.setattr(cache, "_ours", lambda found: True)
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    with pytest.warns(RuntimeWarning, match="no home folder"):
        assert usable_folder("k") == tmp_path / "schuler-54321" / "k"
