"""What is done with one log: a pure function of plain values, for any worker anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from schuler.errors import SchulerError

Outcome = dict[str, Any]
How = dict[str, dict[str, Any]]
"""Options of `read_imu` and `read_gnss`."""
KINDS: tuple[Literal["imu", "gnss"], ...] = ("imu", "gnss")
PROFILE = "for a batch this stands in a profile, which schuler read --save-profile writes"


def work_on(
    file: str, gnss: str, noise: str, calibration: str, profile: str, settings: dict[str, Any]
) -> Outcome:
    """Measure a static log, or judge a drive; a log that cannot be used says why.

    Parameters
    ----------
    file, gnss, noise, calibration, profile : str
        Paths; empty where there is none.
    settings : dict
        Those of `BatchSettings`.
    """
    try:
        given = Path(calibration) if calibration else None
        how = _how(profile, settings)
        how["imu"]["calibration"] = given
        if gnss:
            found = _drive(Path(file), Path(gnss), noise, how, settings)
        else:
            found = _noise(Path(file), how, settings)
        return found | {"calibration": given.read_text(encoding="utf-8") if given else ""}
    except SchulerError as error:
        aside = "" if profile or "=" not in error.cure else f" ({PROFILE})"
        return {"status": "failed", "message": f"{error}{aside}"}
    except MemoryError:
        return {"status": "failed", "message": f"{file}: does not fit into memory"}
    except Exception as error:  # one log must not end a batch of thousands
        return {"status": "failed", "message": f"{file}: {type(error).__name__}: {error} (a bug)"}


def _how(profile: str, settings: dict[str, Any]) -> How:
    """Return how the files of a log are read: the settings of a batch go before a profile."""
    from schuler.io.profile import load_profile

    imu, gnss = (load_profile(profile, k) if profile else {} for k in KINDS)
    sds = {k: settings[k] for k in ("position_sd", "velocity_sd") if settings[k] is not None}
    repair = {"repair": True} if settings["repair"] else {}
    return {"imu": imu | repair, "gnss": gnss | sds}


def _noise(file: Path, how: How, settings: dict[str, Any]) -> Outcome:
    from schuler.estimation.characterization import characterize_imu
    from schuler.io.read import read_imu
    from schuler.screening.screen import repair_until_clean, screen

    imu = read_imu(file, **how["imu"])
    screening = screen(imu)
    screening.require_usable()
    if settings["repair"]:
        imu = repair_until_clean(imu, screening)
    found = characterize_imu(imu, settings["model"])
    figures = [
        (channel, name, c.value, c.standard_error, c.upper_limit)
        for channel, one in found.channels.items()
        for name, c in one.ieee952.items()
    ]
    warnings = [f.message for f in screening.findings if f.severity != "info"]
    return {
        "status": "done",
        "kind": "noise",
        "message": "; ".join(warnings[:3]),
        "seconds": imu.duration,
        "rate": imu.rate,
        "figures": figures,
        "model": found.noise_model.to_yaml("si"),
        "assumptions": list(imu.assumptions),
    }


def _drive(
    file: Path,
    gnss: Path,
    noise: str,
    how: How,
    settings: dict[str, Any],
) -> Outcome:
    from schuler.evaluation.outages import evaluate_outages
    from schuler.io.read import read_gnss, read_imu
    from schuler.noise import NoiseModel

    imu, fixes = read_imu(file, **how["imu"]), read_gnss(gnss, **how["gnss"])
    model = NoiseModel.load(noise) if noise else None
    found = evaluate_outages(
        imu, fixes, model, sweep=tuple(settings["sweep"]), aiding=tuple(settings["aiding"])
    )
    figures = [
        (answer, name, value, None, None)
        for answer, judged in (("causal", found.causal), ("smoothed", found.smoothed))
        for name, value in (
            ("mean of maxima", judged.mean_of_max_m),
            ("worst", judged.worst_m),
            ("inside 2 sigma", judged.within_2_sigma),
            ("claimed/real", judged.claimed_over_real),
        )
    ]
    told = [str(f.get("text", "")) for f in (found.runs[0]["findings"] if found.runs else [])]
    return {
        "status": "done",
        "kind": "drive",
        "message": "; ".join(told[:3]),
        "seconds": imu.duration,
        "rate": imu.rate,
        "figures": figures,
        "model": "",
        "assumptions": [*imu.assumptions, *fixes.assumptions],
    }
