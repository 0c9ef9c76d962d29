"""Beside other programs: CPU time and agreement on the same arrays in the same process.

    python -m benchmarks.peers measure [NAME ...]   run the benchmarks that have a peer, or some of
                                                    them; keep what they print
    python -m benchmarks.peers page                 docs/peers.md of what is kept

What is kept is in benchmarks/results/peers.json; the page is made of that file alone. A benchmark
whose peer is not installed says so and keeps what was there: `pip install spectrum sysidentpy`.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results" / "peers.json"
PAGE = Path(__file__).parents[1] / "docs" / "peers.md"
PEERS = ("allantools", "scipy", "statsmodels", "arch", "PyWavelets", "spectrum", "sysidentpy")

Row = tuple[str, str, float | None, float, str]
"""Task, peer, its CPU seconds, ours, and what the two answers have in common."""


@dataclass(frozen=True)
class Subject:
    """One benchmark, and the lines of the page that are made of what it prints."""

    title: str
    command: tuple[str, ...]
    rows: Callable[[Any], Iterator[Row]]
    words: str = ""


def apart(difference: float) -> str:
    """Tell how far two answers are from one another."""
    return f"apart by {difference:.1g} at most"


def allan(found: Any) -> Iterator[Row]:
    task = f"overlapping, {size(found['samples'])} × {found['channels']}"
    same = f"{apart(found['largest_relative_difference'])} (relative)"
    yield task, "allantools", found["allantools_cpu_s"], found["schuler_cpu_s"], same


def family(found: Any) -> Iterator[Row]:
    for row in found:
        task = f"{row['kind']}, {size(row['peer_samples'])}"
        same = f"{apart(row['largest_relative_difference'])} (relative)"
        yield task, "allantools", row["allantools_cpu_s"], row["schuler_same_load_cpu_s"], same
        if row["samples"] != row["peer_samples"]:
            yield f"{row['kind']}, {size(row['samples'])}", "", None, row["schuler_cpu_s"], ""


def spectrum(found: Any) -> Iterator[Row]:
    speed = found["speed"]
    ours = speed["schuler_psd_cpu_s"]
    yield (
        "spectrum (Welch), 2.52 million",
        "SciPy",
        speed["scipy_welch_same_segment_cpu_s"],
        ours,
        "",
    )
    ours = speed["schuler_acf_with_robust_band_cpu_s"]
    same = f"{apart(speed['acf_largest_difference'])}; ours with a robust band"
    task = "autocorrelation, 10 000 lags"
    yield task, "statsmodels", speed["statsmodels_acf_cpu_s"], ours, same


def autoregressive(found: Any) -> Iterator[Row]:
    for method in ("burg", "yule-walker", "covariance", "modified covariance"):
        here = found[method]
        for key, theirs in here.items():
            peer = key.removesuffix("_cpu_s")
            if peer == key or peer.startswith("schuler"):
                continue
            same = apart(here["largest_difference_to_peer"]) if "," not in peer else ""
            task = f"{method}, orders 1 to {found['orders']}, {size(found['samples'])}"
            yield task, peer, theirs, here["schuler_cpu_s"], same


def arma(found: Any) -> Iterator[Row]:
    for key in found:
        if key.startswith("statsmodels_"):
            peer = found[key]
            most = max(abs(d) for d in peer["ours_less_theirs_in_errors"])
            same = f"apart by {most:.1g} standard errors at most"
            name = f"statsmodels ({key.removeprefix('statsmodels_').replace('_', ' ')})"
            task = f"ARMA(2, 2), exact likelihood, {size(found['samples'])}"
            yield task, name, peer["cpu_s"], found["schuler_cpu_s"], same


def garch(found: Any) -> Iterator[Row]:
    ours = found["schuler"]
    for key, name in (
        ("arch_raw", "as it is, rad/s"),
        ("arch_rescaled", "rescaled"),
        ("arch_from_truth", "started at the truth"),
    ):
        lost = ours["above_truth"] - found[key]["above_truth"]
        same = f"log-likelihood {lost:.3g} below ours" if lost > 0.01 else "the same maximum"
        task = f"GARCH(1, 1), {size(found['samples'])}"
        yield task, f"arch, {name}", found[key]["cpu_s"], ours["cpu_s"], same


def orthogonal(found: Any) -> Iterator[Row]:
    for key, name in (("drawn", "as drawn"), ("zero_start", "first rows zero")):
        if "sysidentpy" not in found:
            return
        theirs, ours = found["sysidentpy"][key], found[f"schuler_{key}"]
        same = "error reductions sum to {:.3f}, ours to {:.3f}".format(
            theirs["sum_of_error_reductions"], ours["sum_of_error_reductions"]
        )
        task = f"65 candidates, {size(found['samples'])}, {name}"
        yield task, "sysidentpy (FROLS)", theirs["cpu_s"], ours["cpu_s"], same


def wavelets(found: Any) -> Iterator[Row]:
    by = {(row["tool"], row["level"]): row for row in found}
    for level in sorted({row["level"] for row in found}):
        theirs = by["pywt by hand, universal", level]
        for ours, rule in (("schuler universal", "the same rule"), ("schuler SURE", "SURE")):
            row = by[ours, level]
            same = f"rms error {theirs['rmse']:.3g}, ours {row['rmse']:.3g}"
            task = f"db4, level {level}, 2.52 million, ours: {rule}"
            yield task, "PyWavelets by hand", theirs["cpu_s"], row["cpu_s"], same


SUBJECTS = {
    "allan_deviation": Subject("Allan deviation", ("allan_deviation",), allan),
    "allan_family": Subject(
        "Its relatives", ("allan_family",), family,
        "The total kinds of allantools grow with the square of the record, so they are compared on "
        "a short one. Ours leave out some of their windows: the answers differ by a fraction of "
        "what the record leaves open.",
    ),
    "spectrum": Subject("Spectrum and autocorrelation", ("spectrum", "--seeds", "1"), spectrum),
    "autoregressive": Subject("Autoregressive models", ("autoregressive",), autoregressive),
    "arma": Subject("ARMA", ("arma",), arma),
    "garch": Subject(
        "GARCH", ("garch",), garch,
        "Noise of a gyro in rad/s is small, and an optimiser that takes numbers as they are stops "
        "where it stands.",
    ),
    "orthogonal_search": Subject(
        "Fast Orthogonal Search", ("orthogonal_search", "--peer", sys.executable), orthogonal,
        "A share of explained variance above what least squares explains is an error: it is what "
        "a first row of zeros does to a sign.",
    ),
    "denoise": Subject("Wavelet de-noising", ("denoise",), wavelets),
}  # fmt: skip

HEAD = """# Beside other programs

<!-- made by python -m benchmarks.peers page -->

CPU seconds of one thread, the least of several runs, on the same arrays in the same process; above
1 in the last column but one, schuler takes less. What the answers have in common stands beside,
because a fast wrong answer is none. Made by `python -m benchmarks.peers measure` and `page`; no
figure is written by hand. How to change over: [coming from another program](coming-from.md).
"""
FOOT = """## What is not here

Programs that are no Python packages (gmwm in R, the MATLAB toolboxes, KF-GINS, NaveGo) are not
measured by this command. Accuracy of navigation has no table either: filters differ in what they
are told, so that a fair comparison is a study of its own.
"""


def size(samples: int) -> str:
    """Tell a number of samples."""
    return f"{samples / 1e6:g} million" if samples >= 1e6 else f"{samples:,}".replace(",", " ")


def measure(names: list[str]) -> int:
    """Run benchmarks and keep what they print; return how many could not."""
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    failed = 0
    for name in names or SUBJECTS:
        module, *options = SUBJECTS[name].command
        print(f"{name} ...", flush=True)
        done = subprocess.run(
            [sys.executable, "-m", f"benchmarks.{module}", *options], capture_output=True, text=True
        )
        if done.returncode:
            failed += 1
            print(f"  left out: {done.stderr.strip().splitlines()[-1]}")
            continue
        known[name] = {
            "found": json.loads(done.stdout),
            "load": round(os.getloadavg()[0], 1),
            "machine": f"{platform.machine()}, Python {platform.python_version()}",
            "versions": dict(versions()),
        }
        RESULTS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return failed


def versions() -> Iterator[tuple[str, str]]:
    """Return the peers that are installed, and their versions."""
    for name in PEERS:
        try:
            yield name, importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue


def page() -> str:
    """Return the page of what is kept."""
    known = json.loads(RESULTS.read_text(encoding="utf-8"))
    lines = [HEAD]
    for name, subject in SUBJECTS.items():
        if name not in known:
            continue
        lines += [f"## {subject.title}", ""]
        lines += ["| task | peer | its CPU s | schuler, CPU s | ratio | the answers |"]
        lines += ["|---|---|---|---|---|---|"]
        for task, peer, theirs, ours, same in subject.rows(known[name]["found"]):
            their, ratio = (
                ("–", "–") if theirs is None else (f"{theirs:.3g}", f"{theirs / ours:.3g}")
            )
            lines.append(f"| {task} | {peer or '–'} | {their} | {ours:.3g} | {ratio} | {same} |")
        lines += ["", subject.words, ""] if subject.words else [""]
    lines += ["## Where it was measured", ""]
    lines += ["| benchmark | machine | load | versions |", "|---|---|---|---|"]
    for name in SUBJECTS:
        if name in known:
            one = known[name]
            told = ", ".join(f"{k} {v}" for k, v in one["versions"].items())
            lines.append(f"| `{name}` | {one['machine']} | {one['load']} | {told} |")
    return "\n".join([*lines, "", FOOT]).rstrip() + "\n"


def main(arguments: list[str]) -> int:
    """Measure, or write the page."""
    task, names = (arguments or [""])[0], arguments[1:]
    unknown = [n for n in names if n not in SUBJECTS]
    if task not in {"measure", "page"} or unknown:
        print(__doc__, f"NAME: {', '.join(SUBJECTS)}", sep="\n", file=sys.stderr)
        return 2
    if task == "measure":
        return 1 if measure(names) else 0
    PAGE.write_text(page(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
