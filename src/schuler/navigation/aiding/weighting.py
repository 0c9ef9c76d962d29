"""How GNSS is weighted: a gate, Huber or Student-t weights, and noise that adapts itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from schuler.errors import InputError
from schuler.types import FloatArray

Update = Literal["gate", "huber", "student-t"]
UPDATES: tuple[str, ...] = get_args(Update)

DOUBTED_SHARE = 0.05
"""Share of good measurements that are doubted: Huber's weight falls, adapted noise clips them."""
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of Student's distribution: tails of real receivers."""
MEMORY = 60.0
"""Updates over which the noise is averaged that adapts itself."""
OWN_WORD = 10.0
"""Updates that the receiver's own word counts for at the start."""
LEAST, MOST = 0.2, 100.0
"""Factor on the receiver's variances: they are never believed to be much too large, as innovations
do not see slow errors, but they may be far too small."""


@dataclass(frozen=True, slots=True)
class GnssWeighting:
    """How GNSS measurements are weighted.

    Parameters
    ----------
    update : {"gate", "huber", "student-t"}
        "gate" refuses what is too far off; "huber" and "student-t" refuse nothing and give
        little weight to it, Student's less than Huber's.
    adaptive : bool
        Whether the variances of position and velocity, one factor each, follow the innovations.
    freedom : float
        Of Student's distribution.
    memory : float
        Updates over which adapted noise is averaged.

    Raises
    ------
    InputError
        Another kind of update, or numbers that cannot be.
    """

    update: Update = "gate"
    adaptive: bool = False
    freedom: float = STUDENT_FREEDOM
    memory: float = MEMORY

    def __post_init__(self) -> None:
        if self.update not in UPDATES:
            raise InputError(f"no update '{self.update}'", expected=", ".join(UPDATES))
        if not (self.freedom > 2.0 and self.memory > 5.0):
            raise InputError(
                f"{self.freedom:g} degrees of freedom, a memory of {self.memory:g} updates",
                expected="more than 2, and more than 5",
            )

    def array(self) -> FloatArray:
        """Return the numbers that kernels/navigation/robust.py wants, (9,)."""
        from scipy.special import gammaincinv

        numbers = np.zeros(9)
        numbers[0] = UPDATES.index(self.update)
        numbers[1:4] = 2.0 * gammaincinv([0.5, 1.0, 1.5], 1.0 - DOUBTED_SHARE)
        numbers[8] = self.freedom
        if self.adaptive:
            numbers[4:8] = 1.0 - 1.0 / self.memory, OWN_WORD, LEAST, MOST
        return numbers


CLAIMED = GnssWeighting()
