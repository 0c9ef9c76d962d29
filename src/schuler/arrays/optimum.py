"""The best geometry within a constraint: a cone's angle, or whatever a user can vary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.geometry import Geometry, cone, cone_with_axis
from schuler.arrays.merit import FiguresOfMerit, figures_of_merit
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray

Criterion = Literal["gdop", "volume", "vertical", "detectable_bias", "isolation"]


@dataclass(frozen=True, slots=True, eq=False)
class OptimalGeometry(Exportable):
    """The best geometry that was found.

    Parameters
    ----------
    parameters : (p,) ndarray
        Where.
    figures : FiguresOfMerit
        Of the geometry there.
    value : float
        Of the criterion, the smaller the better.
    criterion : str
        Its name.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Geometry, optimize_geometry
    >>> def cone(angles):
    ...     s, c = np.sin(angles[0]), np.cos(angles[0])
    ...     return Geometry.from_axes([(s, 0, c), (-s, 0, c), (0, s, c), (0, -s, c)])
    >>> best = optimize_geometry(cone, [(0.2, 1.4)])
    >>> round(float(np.degrees(best.parameters[0])), 1)
    54.7
    """

    parameters: FloatArray
    figures: FiguresOfMerit
    value: float
    criterion: str

    @property
    def geometry(self) -> Geometry:
        """The geometry."""
        return self.figures.geometry


def optimize_cone(
    count: int,
    *,
    with_axis: bool = False,
    criterion: Criterion | Callable[[FiguresOfMerit], float] = "gdop",
    half_angles: tuple[float, float] = (np.radians(1.0), np.radians(89.0)),
) -> OptimalGeometry:
    """Return the best half angle of a cone of single axes.

    Parameters
    ----------
    count : int
        Axes on the cone.
    with_axis : bool
        One more along its middle.
    criterion : str or callable
        "gdop", "volume", "vertical", "detectable_bias", "isolation", or a function of
        `FiguresOfMerit` that has to be small.
    half_angles : (low, high)
        Where it is looked for, rad.

    Returns
    -------
    OptimalGeometry
        Half angle in `parameters`, rad, and figures of merit there.

    Raises
    ------
    InputError
        An unknown criterion, or no geometry that spans three dimensions.

    Notes
    -----
    S002 Fig. 8; 54.7 degrees minimise the GDOP of axes on a cone (Pejsa 1974).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> float(np.degrees(schuler.optimize_cone(6).parameters[0]).round(1))
    54.7
    """
    make = cone_with_axis if with_axis else cone

    def build(parameters: FloatArray) -> Geometry:
        return make(count, float(parameters[0]))

    return optimize_geometry(build, [half_angles], criterion)


def optimize_geometry(
    build: Callable[[FloatArray], Geometry],
    bounds: Sequence[tuple[float, float]],
    criterion: Criterion | Callable[[FiguresOfMerit], float] = "gdop",
    *,
    deviations: ArrayLike = 1.0,
    seed: int = 0,
) -> OptimalGeometry:
    """Return the best geometry of a family.

    Parameters
    ----------
    build : callable
        From the (p,) parameters to a `Geometry`.
    bounds : sequence of (float, float)
        Of each parameter.
    criterion : str or callable
        "gdop", "volume", "vertical" (noise along z), "detectable_bias" (the worst axis),
        "isolation" (angle between the two faults most alike), or a function of the
        `FiguresOfMerit`, the smaller the better.
    deviations : float or (M,) array_like
        Noise of the axes.
    seed : int
        Of the search with several parameters.

    Returns
    -------
    OptimalGeometry
        Parameters, figures of merit there, and the value of the criterion.

    Raises
    ------
    InputError
        Bounds that are empty, an unknown criterion, or no geometry that measures all directions.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Geometry, optimize_geometry
    >>> def cone(angles):
    ...     s, c = np.sin(angles[0]), np.cos(angles[0])
    ...     return Geometry.from_axes([(s, 0, c), (-s, 0, c), (0, s, c), (0, -s, c)])
    >>> best = optimize_geometry(cone, [(0.2, 1.4)])
    >>> round(float(np.degrees(best.parameters[0])), 1)
    54.7
    """
    from scipy.optimize import Bounds, differential_evolution, minimize_scalar

    measure = _measure(criterion)
    limits = [(float(a), float(b)) for a, b in bounds]
    if not limits or any(not a < b for a, b in limits):
        raise InputError(f"bounds {limits}", expected="(low, high) for each parameter")

    def cost(parameters: ArrayLike) -> float:
        try:
            geometry = build(np.atleast_1d(np.asarray(parameters, dtype=np.float64)))
        except InputError:
            return float("inf")
        return measure(figures_of_merit(geometry, deviations))

    if len(limits) == 1:
        low, high = limits[0]
        grid = np.linspace(low, high, 181)
        costs = np.array([cost(g) for g in grid])
        best = int(np.argmin(costs))
        around = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, 180)]))
        found = minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 1e-10})
        # the end of the interval is where a constraint binds
        place = found.x if found.fun < costs[best] else grid[best]
    else:
        low_ends, high_ends = np.transpose(limits)
        within = Bounds(low_ends, high_ends)
        place = differential_evolution(cost, within, seed=seed, tol=1e-6, popsize=10).x
    parameters = np.atleast_1d(np.asarray(place, dtype=np.float64))
    value = cost(parameters)
    if not np.isfinite(value):
        raise InputError(
            "no geometry within these bounds measures all three directions",
            expected="a family with axes that span three dimensions",
        )
    name = criterion if isinstance(criterion, str) else "user's criterion"
    return OptimalGeometry(parameters, figures_of_merit(build(parameters), deviations), value, name)


def _measure(
    criterion: Criterion | Callable[[FiguresOfMerit], float],
) -> Callable[[FiguresOfMerit], float]:
    if callable(criterion):
        return criterion
    known: dict[str, Callable[[FiguresOfMerit], float]] = {
        "gdop": lambda f: f.gdop,
        "volume": lambda f: f.volume,
        "vertical": lambda f: float(np.sqrt(f.covariance[2, 2])),
        "detectable_bias": lambda f: float(f.minimal_detectable_bias.max()),
        "isolation": lambda f: -f.smallest_isolation_angle,
    }
    if criterion not in known:
        raise InputError(f"criterion '{criterion}'", expected=f"one of {', '.join(known)}")
    return known[criterion]
