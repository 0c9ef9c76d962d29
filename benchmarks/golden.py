"""The figures that must not change while the house is rebuilt: record them, compare them.

    python -m benchmarks.golden record FILE [--only NAME ...] [--jobs 2]
    python -m benchmarks.golden compare FILE [--only NAME ...] [--jobs 2] [--strict-text]
    python -m benchmarks.golden list

Works through the command line and the names of `import schuler` alone, so that it outlives every
move of a module. Recordings come from $SCHULER_DATA, or shared/data beside the repository, cut
short. Of every file that a case writes: numbers and texts of JSON and YAML, and for each column of
a table count, sum, sum of squares, extremes, and a digest of its bits. `--only` picks cases by the
beginning of their names.

Equal means within 1e-12 of the value (a sum: of the root of the sum of squares; an extreme: of the
larger extreme). Digests and texts that differ are told; texts fail with `--strict-text` only.
Exit code 1 when a number differs or is missing. Times, versions, memory and where a result came
from are left out, and so are pages.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import hashlib
import json
import math
import sys
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, is_dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import yaml

from benchmarks.golden_cases import CASES, Record, call, write_inputs

TOLERANCE = 1e-12
SHOWN = 12
# exit code of a bug; that it goes away is welcome
BUG = 70
# differ from run to run, or tell where and how long
LEFT_OUT = {"provenance", "version", "created", "command", "cpu_us_per_sample", "smoother_bytes"}
COLUMN = ("count", "sum", "sum_of_squares", "min", "max", "digest")


def summed(values: Any) -> dict[str, Any]:
    """A column in six numbers."""
    array = np.ascontiguousarray(values)
    digest = hashlib.sha256(
        repr(array.tolist()).encode() if array.dtype == object else array.tobytes()
    ).hexdigest()[:16]
    if array.dtype.kind not in "fiub" or array.size == 0:
        return {"count": array.size, "digest": digest}
    numbers = array.astype(np.float64)
    finite = numbers[np.isfinite(numbers)]
    extremes = [float(finite.min()), float(finite.max())] if finite.size else [0.0, 0.0]
    sums = [float(finite.sum()), float(np.square(finite).sum())]
    return dict(zip(COLUMN, [int(finite.size), *sums, *extremes, digest], strict=True))


def flattened(value: Any, key: str, record: Record) -> None:
    """Numbers, texts and summed arrays under their paths."""
    if is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in fields(value)}
    if isinstance(value, Mapping):
        for name, part in value.items():
            if str(name) not in LEFT_OUT:
                flattened(part, f"{key}/{name}", record)
    elif isinstance(value, list | tuple):
        for i, part in enumerate(value):
            flattened(part, f"{key}/{i}", record)
    elif isinstance(value, np.ndarray):
        record[key] = summed(value)
    elif isinstance(value, np.generic):
        record[key] = value.item()
    elif value is None or isinstance(value, str | bool | int | float):
        record[key] = value
    else:
        record[key] = str(type(value).__name__)


def file_record(file: Path, record: Record) -> None:
    if file.suffix == ".json":
        flattened(json.loads(file.read_text(encoding="utf-8")), file.name, record)
    elif file.suffix == ".yaml":
        flattened(yaml.safe_load(file.read_text(encoding="utf-8")), file.name, record)
    elif file.suffix in {".parquet", ".csv"}:
        table = pl.read_parquet(file) if file.suffix == ".parquet" else pl.read_csv(file)
        for name in table.columns:
            record[f"{file.name}/{name}"] = summed(table[name].to_numpy())


def run_case(name: str, folder: Path) -> tuple[str, Record, float]:
    begin = time.process_time()
    record: Record = {}
    case = CASES[name]
    place = folder / name.replace("/", "_")
    place.mkdir()
    try:
        if callable(case):
            flattened(case(folder), "", record)
        else:
            for number, command in enumerate(case.splitlines()):
                code, error = call(command, place)
                record[f"exit code {number}"] = code
                record |= {f"error {number}": error} if error else {}
    except Exception as problem:
        # half a move must not hide what the other cases say; what is missing fails
        record["error"] = repr(problem)
    for file in sorted(place.iterdir()):
        file_record(file, record)
    return name, record, time.process_time() - begin


def run_cases(only: list[str], jobs: int) -> dict[str, Record]:
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    data = Path(os.environ.get("SCHULER_DATA", beside)).resolve()
    names = [n for n in CASES if not only or n.startswith(tuple(only))]
    spent, records, home = 0.0, {}, Path.cwd()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_inputs(data, folder)
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            for name, record, seconds in pool.map(run_case, names, [folder] * len(names)):
                records[name] = record
                spent += seconds
                told = "".join(f"\n    {v}" for k, v in record.items() if k.startswith("error"))
                print(f"{name:40s}{len(record):7d} values {seconds:6.1f} CPU s{told}", flush=True)
        os.chdir(home)
    print(f"{len(records)} cases, {spent:.0f} CPU s")
    return records


# --- comparing -----------------------------------------------------------------------------------


def relative(old: float, new: float, scale: float | None = None) -> float:
    if old == new or (math.isnan(old) and math.isnan(new)):
        return 0.0
    size = max(abs(old), abs(new)) if scale is None else scale
    found = abs(new - old) / size if size > 0.0 else math.inf
    return found if math.isfinite(found) else math.inf


def column_difference(old: Record, new: Record) -> float:
    if set(old) != set(new) or old["count"] != new["count"]:
        return math.inf
    if "sum" not in old:
        return 0.0 if old["digest"] == new["digest"] else math.inf
    largest = max(abs(old["min"]), abs(old["max"]))
    scales = {"sum": math.sqrt(old["sum_of_squares"]), "min": largest, "max": largest}
    return max(relative(old[k], new[k], scales.get(k)) for k in COLUMN[1:-1])


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def compare_case(name: str, old: Record, new: Record, *, strict: bool) -> bool:
    """Print what differs; whether all is equal."""
    worst, bad, texts, bits = 0.0, [], [], []
    for key, was in old.items():
        if key not in new:
            bad.append(f"{key}: missing, was {str(was)[:80]}")
            continue
        now = new[key]
        if key.startswith("exit code") and was == BUG:
            texts += [f"{key}: {was} is now {now}"] if was != now else []
            continue
        if isinstance(was, dict) and isinstance(now, dict):
            found = column_difference(was, now)
            bits += [key] if was["digest"] != now["digest"] else []
        elif isinstance(was, str) and isinstance(now, str):
            texts += [f"{key}: {was!r} is now {now!r}"] if was != now else []
            continue
        elif is_number(was) and is_number(now):
            found = relative(was, now)
        else:
            found = 0.0 if was == now and type(was) is type(now) else math.inf
        worst = max(worst, found)
        if found > TOLERANCE:
            bad.append(f"{key}: {was} is now {now} ({found:.1e})")
    tables = any(isinstance(v, dict) for v in old.values())
    same = "no tables" if not tables else f"bits differ in {len(bits)}" if bits else "bits equal"
    equal = not bad and not (strict and texts)
    verdict = "equal" if equal else f"DIFFERENT in {len(bad)}"
    print(f"{name:40s}{len(old):7d} values, largest {worst:.1e}, {same}: {verdict}")
    for title, lines in (("", bad), ("text: ", texts)):
        for line in lines[:SHOWN]:
            print(f"    {title}{line}")
        if len(lines) > SHOWN:
            print(f"    {title}and {len(lines) - SHOWN} more")
    extra = [key for key in new if key not in old]
    if extra:
        print(f"    {len(extra)} that were not there: {', '.join(extra[:5])}")
    return equal


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("what", choices=("record", "compare", "list"))
    parser.add_argument("file", type=Path, nargs="?", default=Path("golden.json"))
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--strict-text", action="store_true")
    given = parser.parse_args()
    if given.what == "list":
        print("\n".join(CASES))
        return 0
    target = given.file.resolve()
    kept = json.loads(target.read_text(encoding="utf-8")) if given.what == "compare" else {}
    records = run_cases(given.only, given.jobs)
    if given.what == "record":
        target.write_text(json.dumps(records, indent=0), encoding="utf-8")
        return 0
    wanted = [n for n in kept if not given.only or n.startswith(tuple(given.only))]
    missing = [n for n in wanted if n not in records]
    # through JSON and back, so that both sides hold the same kinds
    fresh = json.loads(json.dumps(records))
    strict = given.strict_text
    results = [
        compare_case(n, kept[n], fresh[n], strict=strict) for n in wanted if n not in missing
    ]
    for name in missing:
        print(f"{name}: MISSING")
    print(f"{sum(results)} of {len(wanted)} cases equal")
    return 0 if all(results) and not missing else 1


if __name__ == "__main__":
    sys.exit(main())
