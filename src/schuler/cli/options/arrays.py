"""An array of IMUs in place of one, as options of the command line."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from schuler.cli.options.groups import ARRAY
from schuler.cli.parsing import parse_numbers
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.data.mounting import Mounting


@Parameter(name="*", group=ARRAY)
@dataclass(frozen=True)
class ArrayOptions:
    """Several IMUs on one body instead of one.

    Parameters
    ----------
    array : tuple of Path
        Recording of an array: one file or folder with several IMUs, or a file for each. May be
        repeated; takes the place of --imu.
    mount : tuple of str
        ROLL,PITCH,YAW[,X,Y,Z] of an IMU, in the order of the array: deg that turn the axes of the
        body into those of the IMU, and its place on the body in m. Given once for each IMU; all
        are aligned with the body if left out.
    mechanization : str
        single, synthetic, extended, constrained or system; all compares them.
    parity : bool
        Whether the extended filter learns the bias of every sensor from the differences between
        them; --without-parity switches that off.
    faults : bool
        Whether faults of sensors are looked for, and sensors not used while they are faulty;
        --without-faults switches that off.
    weights : str
        auto, constant, averaged_volatility, ewma or garch: how sensors are weighted as their noise
        changes.
    follow_axes : bool
        Follow IMUs that turn slowly against one another (a mounting that bends, temperature), and
        clocks that drift, by what all feel of the rotation; each sample by what came before it.
    window : tuple of str
        START:SECONDS without GNSS, seconds after the first epoch, which then judges the
        mechanizations there. May be repeated.
    """

    array: Annotated[tuple[Path, ...], Parameter(negative=())] = ()
    mount: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    mechanization: str = "extended"
    parity: Annotated[bool, Parameter(negative="--without-parity")] = True
    faults: Annotated[bool, Parameter(negative="--without-faults")] = True
    weights: str = "auto"
    follow_axes: Annotated[bool, Parameter(negative=())] = False
    window: Annotated[tuple[str, ...], Parameter(negative=())] = ()

    def files(self, imu: Path | None) -> tuple[Path, ...]:
        """Return the files of the IMU or of the array; raise unless there is one of the two."""
        if (imu is None) == (not self.array):
            raise InputError(
                "no IMU" if imu is None else "--imu and --array together",
                expected="--imu FILE, or --array FILE (may be repeated)",
            )
        return self.array if imu is None else (imu,)

    def mounting(self, count: int) -> Mounting | None:
        """Return the mounting of all IMUs, None where nothing was said."""
        import numpy as np

        from schuler.data.mounting import Mounting
        from schuler.rotations import dcm_from_euler

        if not self.mount:
            return None
        if len(self.mount) != count:
            raise InputError(
                f"{len(self.mount)} mountings for {count} IMUs",
                expected="--mount once for each IMU",
            )
        example = "--mount ROLL,PITCH,YAW or ROLL,PITCH,YAW,X,Y,Z (deg, m), such as 0,0,-1.8"
        rotations, positions = [], []
        for text in self.mount:
            numbers = parse_numbers(text, 6 if text.count(",") > 2 else 3, example)
            rotations.append(dcm_from_euler(*(radians(a) for a in numbers[:3])))
            positions.append(numbers[3:] or (0.0, 0.0, 0.0))
        return Mounting(np.stack(rotations), np.array(positions))
