"""What is done with one log: a pure function of plain values, for any worker anywhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from schuler.errors import SchulerError

Outcome = dict[str, Any]


def work_on(
    file: str, gnss: str, noise: str, calibration: str, settings: dict[str, Any]
) -> Outcome:
    """Measure a static log, or judge a drive; a log that cannot be used says why.

    Parameters
    ----------
    file, gnss, noise, calibration : str
        Paths; empty where there is none.
    settings : dict
        Those of `BatchSettings`.
    """
    try:
        given = Path(calibration) if calibration else None
        found = (
            _drive(file, gnss, noise, given, settings) if gnss else _noise(file, given, settings)
        )
        return found | {"calibration": given.read_text(encoding="utf-8") if given else ""}
    except SchulerError as error:
        return {"status": "failed", "message": str(error)}
    except MemoryError:
        return {"status": "failed", "message": f"{file}: does not fit into memory"}
    except Exception as error:  # one log must not end a batch of thousands
        return {"status": "failed", "message": f"{file}: {type(error).__name__}: {error} (a bug)"}


def _noise(file: str, calibration: Path | None, settings: dict[str, Any]) -> Outcome:
    from schuler.estimation.characterization import characterize_imu
    from schuler.io.read import read_imu
    from schuler.screening.screen import repair_until_clean, screen

    imu = read_imu(Path(file), calibration=calibration, repair=settings["repair"])
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
    file: str, gnss: str, noise: str, calibration: Path | None, settings: dict[str, Any]
) -> Outcome:
    from schuler.evaluation.outages import evaluate_outages
    from schuler.io.read import read_gnss, read_imu
    from schuler.noise import NoiseModel

    imu = read_imu(Path(file), calibration=calibration, repair=settings["repair"])
    fixes = read_gnss(
        Path(gnss), position_sd=settings["position_sd"], velocity_sd=settings["velocity_sd"]
    )
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
