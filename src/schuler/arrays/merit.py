"""How good a geometry is: noise of the fused rate, and what faults it can see and tell apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.geometry import Geometry
from schuler.data._checks import frozen
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray

PARALLEL = 1e-6
"""Two faults whose parity directions differ by less (1 - |cosine|) cannot be told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class FiguresOfMerit(Exportable):
    """What a geometry can do, for sensors of given noise.

    Parameters
    ----------
    geometry : Geometry
        The axes.
    deviations : (M,) ndarray
        Standard deviation of the noise of each axis.
    covariance : (3, 3) ndarray
        Of the fused vector, (A' P A)^-1, in the square of the unit of the deviations.
    residual_share : (M,) ndarray
        Of a fault on each sensor that shows in its own whitened residual, S_ii in [0, 1]; zero
        means that the fault cannot be seen.
    minimal_detectable_bias : (M,) ndarray
        Fault found with the wanted power at the wanted false-alarm rate by the chi-square test,
        same unit as the deviations; infinite where it cannot be seen.
    false_alarm_rate, power : float
        For which.
    isolation_angle : (M, M) ndarray
        Between the traces of two faults in the parity space, rad, in [0, pi/2]; zero when they
        look alike, NaN when one is not seen.

    Examples
    --------
    >>> from schuler import Geometry, figures_of_merit
    >>> four = Geometry.from_axes([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.6, 0.6]])
    >>> figures_of_merit(four).covariance.shape
    (3, 3)
    """

    geometry: Geometry
    deviations: FloatArray
    covariance: FloatArray
    residual_share: FloatArray
    minimal_detectable_bias: FloatArray
    false_alarm_rate: float
    power: float
    isolation_angle: FloatArray

    @property
    def parity(self) -> FloatArray:
        """Rows blind to motion, (M - 3, M): V A = 0, with unit noise each (spec 6.4)."""
        return parity_matrix(self.geometry.axes, self.deviations)

    @property
    def threshold(self) -> float:
        """Of the chi-square statistic of a sample at the false-alarm rate; infinite without one."""
        from scipy.stats import chi2

        if self.geometry.redundancy < 1:
            return float("inf")
        return float(chi2.isf(self.false_alarm_rate, self.geometry.redundancy))

    @property
    def gdop(self) -> float:
        """Square root of the trace of the covariance."""
        return float(np.sqrt(np.trace(self.covariance)))

    @property
    def determinant(self) -> float:
        """Of the information matrix A' P A."""
        return float(1.0 / np.linalg.det(self.covariance))

    @property
    def volume(self) -> float:
        """Of the ellipsoid of one standard deviation of the fused vector."""
        return float(4.0 / 3.0 * np.pi * np.sqrt(np.linalg.det(self.covariance)))

    @property
    def anisotropy(self) -> float:
        """Largest over smallest standard deviation of the fused vector by direction."""
        values = np.linalg.eigvalsh(self.covariance)
        return float(np.sqrt(values[2] / values[0]))

    @property
    def smallest_isolation_angle(self) -> float:
        """Between the traces of the two faults that are hardest to tell apart, rad."""
        upper = self.isolation_angle[np.triu_indices(self.geometry.count, 1)]
        return float(np.nanmin(upper)) if np.isfinite(upper).any() else 0.0

    @property
    def inseparable(self) -> tuple[tuple[str, ...], ...]:
        """Groups of sensors whose faults look alike: detected, but not isolated (E-002-12)."""
        count, groups, done = self.geometry.count, [], set[int]()
        alike = np.cos(self.isolation_angle) > 1.0 - PARALLEL
        for i in range(count):
            group = [j for j in range(i, count) if j == i or alike[i, j]]
            if i not in done and len(group) > 1:
                groups.append(tuple(self.geometry.names[j] for j in group))
            done |= set(group)
        return tuple(groups)

    @property
    def statements(self) -> tuple[str, ...]:
        """In plain words what cannot be done, empty if nothing."""
        said = []
        unseen = np.flatnonzero(self.residual_share < PARALLEL)
        if self.geometry.redundancy == 0:
            said.append("Three axes and no more: no fault can be detected.")
        elif unseen.size:
            names = ", ".join(self.geometry.names[i] for i in unseen)
            said.append(f"A fault of {names} cannot be detected: nothing else measures there.")
        if self.inseparable:
            groups = "; ".join(" and ".join(g) for g in self.inseparable)
            said.append(f"Faults can be detected but not isolated between {groups}.")
        return tuple(said)

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON; angles in rad."""
        finite = np.isfinite
        bias, angle = self.minimal_detectable_bias, self.isolation_angle
        return {
            "title": self.geometry.title,
            "names": list(self.geometry.names),
            "axes": self.geometry.axes.tolist(),
            "units": self.geometry.units.tolist(),
            "redundancy": self.geometry.redundancy,
            "deviations": self.deviations.tolist(),
            "covariance": self.covariance.tolist(),
            "gdop": self.gdop,
            "volume": self.volume,
            "anisotropy": self.anisotropy,
            "parity": self.parity.tolist(),
            "residual_share": self.residual_share.tolist(),
            "false_alarm_rate": self.false_alarm_rate,
            "power": self.power,
            "threshold": self.threshold if self.geometry.redundancy else None,
            "minimal_detectable_bias": [v if finite(v) else None for v in bias.tolist()],
            "isolation_angle": [[v if finite(v) else None for v in r] for r in angle.tolist()],
            "smallest_isolation_angle": self.smallest_isolation_angle,
            "statements": list(self.statements),
        }


def parity_matrix(axes: FloatArray, deviations: FloatArray) -> FloatArray:
    """Return rows that are blind to motion: V A = 0, orthonormal for the whitened sensors.

    Parameters
    ----------
    axes : (M, 3) ndarray
        Sensitive axes in the body, A.
    white : (M,) ndarray
        Standard deviations or densities of the sensors, in any unit.

    Returns
    -------
    (M - 3, M) ndarray
        V: the parity vector V l of sensors with this noise has the unit covariance.

    Notes
    -----
    S002 (2).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> axes = schuler.Geometry.from_mounting(schuler.tetrahedron_mounting()).axes
    >>> v = schuler.parity_matrix(axes, np.ones(12))
    >>> v.shape, bool(np.allclose(v @ axes, 0.0))
    ((9, 12), True)
    """
    whole, _ = np.linalg.qr(axes / deviations[:, None], mode="complete")
    return np.asarray(whole[:, 3:].T / deviations)


def figures_of_merit(
    geometry: Geometry,
    deviations: ArrayLike = 1.0,
    *,
    false_alarm_rate: float = 0.001,
    power: float = 0.8,
) -> FiguresOfMerit:
    """Return what a geometry can do.

    Parameters
    ----------
    geometry : Geometry
        The axes.
    deviations : float or (M,) array_like
        Standard deviation of the noise of each axis, any unit.
    false_alarm_rate, power : float
        Of the chi-square test of one sample, for the smallest fault that is found.

    Returns
    -------
    FiguresOfMerit
        Noise of the fused vector, parity, and what faults can be seen and told apart (spec 6.1,
        6.4; S002 (8) and Fig. 8).

    Raises
    ------
    InputError
        Deviations that are not positive, or rates out of range.

    Examples
    --------
    >>> from schuler import Geometry, figures_of_merit
    >>> round(figures_of_merit(Geometry.named("tetrahedron")).gdop, 4)
    0.866
    """
    sigma = np.broadcast_to(np.asarray(deviations, dtype=np.float64), (geometry.count,))
    sigma = frozen(sigma, "deviations", (geometry.count,))
    if not (np.isfinite(sigma).all() and sigma.min() > 0.0):
        raise InputError("deviations that are not positive", expected="finite numbers above zero")
    if not 0.0 < false_alarm_rate < power < 1.0:
        raise InputError(
            f"a false-alarm rate of {false_alarm_rate:g} and a power of {power:g}",
            expected="0 < false-alarm rate < power < 1",
        )
    whitened = geometry.axes / sigma[:, None]
    q, r = np.linalg.qr(whitened)
    inverse = np.linalg.inv(r)
    parity = np.eye(geometry.count) - q @ q.T
    share = np.clip(np.diag(parity), 0.0, 1.0)
    share = np.where(share < 1e-12, 0.0, share)
    with np.errstate(divide="ignore", invalid="ignore"):
        cosine = np.abs(parity) / np.sqrt(np.outer(share, share))
        root = np.sqrt(noncentrality(geometry.redundancy, false_alarm_rate, power))
        bias = np.where(share > 0.0, root * sigma / np.sqrt(share), np.inf)
    return FiguresOfMerit(
        geometry,
        sigma,
        inverse @ inverse.T,
        share,
        bias,
        false_alarm_rate,
        power,
        np.arccos(np.clip(cosine, 0.0, 1.0)),
    )


def noncentrality(freedom: int, false_alarm_rate: float, power: float) -> float:
    """Return the non-centrality at which a chi-square test has a given power."""
    if freedom < 1:
        return float("inf")
    from scipy.optimize import brentq
    from scipy.stats import chi2, ncx2

    threshold = float(chi2.isf(false_alarm_rate, freedom))

    def lack(value: float) -> float:
        return float(ncx2.sf(threshold, freedom, value)) - power

    high = 1.0
    while lack(high) < 0.0:
        high *= 2.0
    return float(brentq(lack, 0.0 if high == 1.0 else 0.5 * high, high, xtol=1e-10))
