"""The command line as part of where a result came from."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schuler.report.provenance import Provenance


def command_provenance(
    *,
    inputs: Iterable[Path] = (),
    seeds: Mapping[str, int] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Provenance:
    """Record this command with its inputs."""
    from schuler.data.to_dict import plain
    from schuler.report.provenance import record_provenance

    return record_provenance(
        command="schuler " + shlex.join(sys.argv[1:]),
        inputs=inputs,
        seeds=seeds,
        settings=plain(dict(settings or {})),
    )
