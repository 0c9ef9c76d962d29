"""Fuzzing of every reader: damaged files may be refused, and nothing else.

    python -m benchmarks.fuzz --cases 1000000 [--format npz] [--seed 1] [--processes 2]

Case k of a seed is the same in every run. Cases run one after the other in a child process with
limits, which is replaced when it ends or has grown; a find is a foreign exception, an end of the
process, more than 10 s of CPU or a minute of waiting, or more than 1 GB. Where the reader decodes
a file in a process of its own (MATLAB), the child is that process, which is faster; a case that
ends it, or takes too long or too much there, is read once more as users read it, and is a find
if that is not refused. Finds of a few kB go to tests/io/finds, which the tests read again.
"""

from __future__ import annotations

import argparse
import faulthandler
import io
import json
import mmap
import os
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import time
import traceback
import warnings
import zipfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

SECONDS = 10.0
WAITING = 60.0
RESIDENT = 1 << 30
ADDRESSES = 6 << 30
ENOUGH, TOO_LARGE = 3, 4
NASTY = (
    b"|nan|inf|-inf|1e400|-1|0|1e-320|9999999999999999999999999|1e15|'|\"|;|,,|\t|\xff|\x00|\xd9\xa3"
    b"|#|%|1_000|- |: |[|{|&a|*a|!!set|~|true|2024-13-45|0x1F|=1+1"
).split(b"|")
WORDS = [0, 1, 127, 128, 255, 256, 32767, 65535, *(2**k + d for k in (31, 32, 63) for d in (-1, 0))]
Find = tuple[int, str, str]
"""Case, what happened, and where."""
TRIED = "ended only the process that decodes them"
TOKEN = re.compile(rb"[-+.\w]+")


def damage(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Return a file with one to four kinds of damage."""
    if data[:4] == b"PK\x03\x04" and rng.random() < 0.7:
        return _damage_member(data, rng, others)
    text = b"\0" not in data[:4000]
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        data = (_damage_text if text and rng.random() < 0.7 else _damage_bytes)(data, rng, others)
    return data


def _damage_member(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Damage an array in an archive; its check sum is right again afterwards."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = rng.choice(list(members))
    own = members[chosen]
    head = own[:128]
    members[chosen] = (_damage_text(head, rng, others) + own[128:] if rng.random() < 0.5
                       else _damage_bytes(own, rng, others))  # fmt: skip
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return out.getvalue()


def _damage_text(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    how = rng.randrange(6)
    if how <= 2:
        tokens = list(TOKEN.finditer(data))
        if not tokens:
            return data + rng.choice(NASTY)
        # Heads of files matter more than their thousandth line.
        k = rng.randrange(min(len(tokens), 40) if rng.random() < 0.5 else len(tokens))
        return data[: tokens[k].start()] + rng.choice(NASTY) + data[tokens[k].end() :]
    lines = data.split(b"\n")
    k = rng.randrange(len(lines))
    if how == 3:
        del lines[k]
    elif how == 4:
        lines.insert(k, rng.choice(lines))
    else:
        lines[k] = lines[k][: rng.randrange(len(lines[k]) + 1)]
    return b"\n".join(lines)


def _damage_bytes(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    if not data:
        return rng.randbytes(8)
    out = bytearray(data)
    zone = rng.random()
    end = len(out)
    at = rng.randrange(min(end, 300)) if zone < 0.3 else (
        rng.randrange(max(end - 1500, 0), end) if zone < 0.5 else rng.randrange(end))  # fmt: skip
    how = rng.randrange(8)
    if how == 0:
        out[at] ^= 1 << rng.randrange(8)
    elif how == 1:
        out[at] = rng.randrange(256)
    elif how == 2:
        del out[at:]
    elif how == 3:
        del out[at : at + rng.choice((1, 2, 4, 8, 100))]
    elif how == 4:
        out[at:at] = rng.randbytes(rng.choice((1, 2, 4, 8, 100)))
    elif how == 5:
        out[at:at] = out[at : at + rng.choice((1, 8, 64, 500))]
    elif how == 6:
        size = rng.choice((1, 2, 4, 8))
        word = (rng.choice(WORDS) & (256**size - 1)).to_bytes(size, rng.choice(("little", "big")))
        out[at : at + size] = word
    else:
        other = rng.choice(others)
        start = rng.randrange(len(other))
        out[at : at + 200] = other[start : start + 200]
    return bytes(out)


def read(path: Path, rng: random.Random) -> None:
    """Read a file by every reader it could be meant for."""
    from benchmarks.fuzz_seeds import noise_of
    from schuler import ArrayCalibration, ImuCalibration, read_gnss, read_imu
    from schuler.cli.verbs.run import _steps
    from schuler.data.mounting import read_mounting
    from schuler.errors import SchulerError
    from schuler.io.profile import load_profile
    from schuler.io.read import read_imus

    how = {"repair": True} if rng.random() < 0.3 else {}
    by_ending = {
        "noise": [noise_of], "mounting": [read_mounting], "job": [lambda p: list(_steps(p))],
        "profile": [lambda p: load_profile(p, "imu"), lambda p: load_profile(p, "gnss")],
        "array_calibration": [ArrayCalibration.load], "imu_calibration": [ImuCalibration.load],
    }  # fmt: skip
    readers = by_ending.get(path.stem) if path.suffix == ".yaml" else None
    imu = read_imus if rng.random() < 0.5 else read_imu
    for one in readers or [lambda p: imu(p, **how), lambda p: read_gnss(p, **how)]:
        try:
            one(path)
        except SchulerError:
            continue


def case(
    name: str, seed: int, k: int, files: dict[str, bytes], folder: Path
) -> tuple[Path, random.Random]:
    """Write case k of a seed file."""
    rng = random.Random(f"{name}:{seed}:{k}")
    path = folder / name
    path.write_bytes(damage(files[name], rng, list(files.values())))
    return path, rng


def work(wanted: str, seed: int, first: int, last: int, place: Path, apart: bool) -> None:
    """Run cases in this process; the number of the one that runs stands in a file."""
    from benchmarks.fuzz_seeds import seeds
    from schuler.io.formats import matlab

    files = seeds()
    names = chosen(files, wanted)
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    # An alarm costs nothing; a watching thread has to be started and joined for each case.
    for told in (signal.SIGXCPU, signal.SIGALRM):
        faulthandler.register(told, chain=True)
    with TemporaryDirectory() as folder, place.open("r+b") as stream:
        at = mmap.mmap(stream.fileno(), 9)
        if not apart:
            matlab.decoded_apart = partial(decode_here, at)  # type: ignore[assignment]
        started = time.monotonic()
        for k in range(first, last):
            if k > first and k % 10_000 == 0:
                print(f"case {k}, {time.monotonic() - started:.0f} s", flush=True)
            at[:9] = k.to_bytes(8, "little") + b"\0"
            path, rng = case(names[k % len(names)], seed, k, files, Path(folder))
            spent = int(time.process_time() + SECONDS + 1.0)
            resource.setrlimit(resource.RLIMIT_CPU, (spent, resource.RLIM_INFINITY))
            signal.setitimer(signal.ITIMER_REAL, WAITING)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    read(path, rng)
            except Exception as error:
                frames = traceback.extract_tb(error.__traceback__)[:-4:-1]
                where = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in frames)
                print(json.dumps([k, f"{type(error).__name__}: {error}"[:150], where]), flush=True)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            path.unlink()
            if resident() > RESIDENT:
                if at[8]:
                    sys.exit(TOO_LARGE)
                print(json.dumps([k, "more than 1 GB", ""]), flush=True)
                sys.exit(ENOUGH)


def decode_here(at: mmap.mmap, path: Path, title: str, module: str, name: str) -> Any:
    """Decode a file as `decoder_process` does, without a process for each case."""
    from schuler.io.format import damaged
    from schuler.io.formats.decoder_process import only_numbers

    at[8] = 1
    try:
        return only_numbers(getattr(import_module(module), name)(path))
    except MemoryError as error:
        raise damaged(path, title, error) from None


def resident() -> int:
    """Return the most memory this process had; what rusage tells goes back to its parent."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return 1024 * int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0])
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def chosen(files: dict[str, bytes], wanted: str) -> list[str]:
    """Return the seed files with this in their names."""
    return [name for name in files if wanted in name]


def campaign(wanted: str, seed: int, first: int, last: int, apart: bool = False) -> list[Find]:
    """Run cases in child processes, a new one after each that ended, and return the finds."""
    finds: list[Find] = []
    with TemporaryDirectory() as folder:
        place = Path(folder) / "case"
        while first < last:
            place.write_bytes(bytes(9))
            what = (wanted, str(seed), str(first), str(last), str(place), str(int(apart)))
            command = [sys.executable, "-m", "benchmarks.fuzz", "--work", *what]
            quiet = {"POLARS_MAX_THREADS": "1", "RUST_BACKTRACE": "0"}
            trouble = place.with_suffix(".err")
            with trouble.open("w") as errors, subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=errors, text=True, env=os.environ | quiet
            ) as done:  # fmt: skip
                for line in done.stdout or ():
                    if line.startswith("["):
                        finds.append(tuple(json.loads(line)))
                    print(line, end="", file=sys.stderr, flush=True)
            if done.returncode == 0:
                break
            at, tried = struct.unpack("<Q?", place.read_bytes())
            if done.returncode != ENOUGH:
                told = trouble.read_text(errors="replace").strip()
                again = campaign(wanted, seed, at, at + 1, apart=True) if tried else []
                finds += again or [_ended(at, tried, done.returncode, told)]
                print(finds[-1], file=sys.stderr, flush=True)
            first = at + 1
    return finds


def _ended(at: int, tried: bool, code: int, told: str) -> Find:
    """Tell how a child ended."""
    if tried:
        return at, TRIED, told[-300:]
    if -code in (signal.SIGXCPU, signal.SIGALRM):
        return at, f"more than {SECONDS:g} s", told[-300:]
    if code > 0:
        raise RuntimeError(told)  # the worker itself cannot run
    return at, f"the process ended with {code}", told[-300:]


def main() -> int:
    """Run the campaign and print a table of finds by place."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000, help="over all seed files")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--format", default="", help="only seed files with this in their name")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the first find of each place")
    parser.add_argument("--work", nargs=6, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.work:
        wanted, seed, first, last, place, apart = options.work
        work(wanted, int(seed), int(first), int(last), Path(place), apart == "1")
        return 0
    from benchmarks.fuzz_seeds import seeds

    files = seeds()
    names = chosen(files, options.format)
    edges = [options.first + options.cases * k // options.processes
             for k in range(options.processes + 1)]  # fmt: skip
    with ThreadPoolExecutor(options.processes) as pool:
        parts = pool.map(partial(campaign, options.format, options.seed), edges[:-1], edges[1:])
        every = [find for part in parts for find in part]
    found = [find for find in every if find[1] != TRIED]
    places: dict[tuple[str, str], list[Find]] = {}
    for find in found:
        places.setdefault((find[1].partition(":")[0], find[2]), []).append(find)
    for (what, where), those in sorted(places.items(), key=lambda item: -len(item[1])):
        k, message, _ = those[0]
        name = names[k % len(names)]
        print(f"{len(those):6d} {what} at {where}\n       first: case {k}, {name}: {message}")
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
            path, _ = case(name, options.seed, k, files, options.keep)
            path.rename(options.keep / f"{options.seed}-{k}-{name}")
    print(
        f"{options.cases} cases of {len(names)} files: {len(found)} finds at {len(places)} places; "
        f"{len(every) - len(found)} {TRIED}"
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
