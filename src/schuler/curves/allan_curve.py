"""A curve of Allan deviations against cluster time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data.exportable import Exportable
from schuler.types import FloatArray

_PER_DECADE = 20


@dataclass(frozen=True, slots=True, eq=False)
class AllanCurve(Exportable):
    """Allan deviation against cluster time.

    Parameters
    ----------
    tau : (t,) ndarray
        Cluster times in s.
    deviation : (t,) or (t, m) ndarray
        Allan deviation in the unit of the signal.
    lower, upper : (t,) or (t, m) ndarray
        95 % confidence interval of the deviation.
    degrees_of_freedom : (t,) or (t, m) ndarray
        Equivalent degrees of freedom of the variance.
    rate : float
        Samples a second.
    samples : int
        Length of the signal.
    kind : str
        Which estimator, as of `allan_deviation`.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import allan_deviation
    >>> curve = allan_deviation(np.random.default_rng(1).standard_normal(10_000), 100.0)
    >>> bool((curve.lower < curve.deviation).all() and (curve.deviation < curve.upper).all())
    True
    """

    tau: FloatArray
    deviation: FloatArray
    lower: FloatArray
    upper: FloatArray
    degrees_of_freedom: FloatArray
    rate: float
    samples: int
    kind: str = "overlapping"

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples / self.rate

    @property
    def factors(self) -> NDArray[np.int64]:
        """Samples in a cluster."""
        return np.round(self.tau * self.rate).astype(np.int64)

    def column(self, index: int) -> AllanCurve:
        """Return the curve of one column of an (n, m) signal.

        Parameters
        ----------
        index : int
            Column.

        Returns
        -------
        AllanCurve
            With (t,) arrays.
        """
        if self.deviation.ndim == 1:
            return self
        return AllanCurve(
            self.tau,
            self.deviation[:, index],
            self.lower[:, index],
            self.upper[:, index],
            self.degrees_of_freedom[:, index],
            self.rate,
            self.samples,
            self.kind,
        )


def default_factors(samples: int, per_decade: int = _PER_DECADE) -> NDArray[np.int64]:
    """Cluster lengths, log-spaced: unique integers up to a ninth of the record (spec 2.3)."""
    longest = max(1, samples // 9)
    count = int(np.ceil(np.log10(longest) * per_decade)) + 1
    return np.unique(np.round(np.geomspace(1, longest, count)).astype(np.int64))
