"""An experiment on many draws: means with errors, methods compared on the same draws, squares."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.evaluation.paired import PairedStatistics, paired_statistics
from schuler.execution import Kept, Task, Workers, lent, run_tasks, workers
from schuler.types import FloatArray

Experiment = Callable[[np.random.Generator], Mapping[str, ArrayLike]]


@dataclass(frozen=True, slots=True, eq=False)
class MonteCarloResult(Exportable):
    """What an experiment gave, run by run.

    Parameters
    ----------
    values : dict of str to (runs, ...) ndarray
        Each quantity, one entry a run.
    seed : int
        From which every run has its own stream.

    Examples
    --------
    >>> from schuler import monte_carlo
    >>> result = monte_carlo(lambda rng: {"mean": rng.standard_normal(9).mean()}, runs=20, seed=1)
    >>> result.seed, result.values["mean"].size
    (1, 20)
    """

    values: dict[str, FloatArray]
    seed: int

    @property
    def runs(self) -> int:
        """How many."""
        return len(next(iter(self.values.values())))

    def mean(self, name: str) -> FloatArray:
        """Return the mean of a quantity over the runs."""
        return np.asarray(self._of(name).mean(axis=0))

    def standard_error(self, name: str) -> FloatArray:
        """Return the standard error of the mean."""
        return np.asarray(self._of(name).std(axis=0, ddof=1) / math.sqrt(self.runs))

    def compare(self, a: str, b: str) -> PairedStatistics:
        """Compare two quantities of the same runs, one number a run.

        Parameters
        ----------
        a, b : str
            Errors of two methods.

        Returns
        -------
        PairedStatistics
            Mean difference with its standard error, wins, tests.
        """
        return paired_statistics(self._of(a), self._of(b))

    def squares_within(
        self, name: str, freedom: float, probability: float = 0.999
    ) -> tuple[float, float, float]:
        """Judge normalised squares (NEES, NIS), each of so many degrees of freedom.

        Parameters
        ----------
        name : str
            Squares, one number a run.
        freedom : float
            Degrees of freedom of one run.
        probability : float
            Of the band.

        Returns
        -------
        mean, low, high : float
            Mean per degree of freedom, and the band in which it lies with that probability if the
            claims are right.
        """
        from scipy.stats import chi2

        total = self.runs * freedom
        low, high = (
            float(chi2.ppf(0.5 + side * 0.5 * probability, total)) / total for side in (-1.0, 1.0)
        )
        return float(self._of(name).mean() / freedom), low, high

    def _of(self, name: str) -> FloatArray:
        if name not in self.values:
            raise InputError(
                f"no quantity '{name}'", expected=f"one of {', '.join(sorted(self.values))}"
            )
        return self.values[name]


def monte_carlo(
    experiment: Experiment,
    runs: int,
    seed: int,
    *,
    executor: Executor | Workers | None = None,
    kept: Kept | None = None,
    told: Callable[[str, int, int], None] | None = None,
) -> MonteCarloResult:
    """Repeat an experiment on independent draws; run k is the same whoever does it.

    Parameters
    ----------
    experiment : callable
        Takes a generator and returns numbers or arrays by name, the same names and shapes each
        time. Methods that are compared belong into one experiment: they then see the same draws.
        For other processes it has to stand at the top of a module.
    runs : int
        How many.
    seed : int
        Each run has its own stream of it.
    executor : concurrent.futures.Executor, Workers or None
        Who works: any executor (threads pay where kernels do the work: they leave the lock), or
        what `schuler.execution.workers` returns; None: this process.
    kept : Kept or None
        Folder where each run is kept: one that was stopped goes on.
    told : callable or None
        Called with name of the run, number done, number of all.

    Returns
    -------
    MonteCarloResult
        Values by run, means, errors, comparisons.

    Raises
    ------
    InputError
        Fewer than two runs, names or shapes that change from run to run, numbers that are not
        finite.

    Examples
    --------
    >>> from schuler import monte_carlo
    >>> def experiment(rng):
    ...     draws = rng.standard_normal(100)
    ...     return {"mean": abs(draws.mean()), "median": abs(float(sorted(draws)[50]))}
    >>> result = monte_carlo(experiment, runs=200, seed=1)
    >>> result.compare("mean", "median").difference < 0.0
    True
    """
    if runs < 2:
        raise InputError(f"{runs} runs", expected="two or more")
    tasks = [Task(f"{seed}-{k:06d}", _one_run, (experiment, seed, k)) for k in range(runs)]
    given = workers(1) if executor is None else executor
    crew = given if isinstance(given, Workers) else lent(given)
    found = list(run_tasks(tasks, crew, kept, told).values())
    names = set(found[0]) - {"cpu seconds"}
    values = {}
    for name in sorted(names):
        shapes = {np.shape(one[name]) for one in found if name in one}
        if len(shapes) != 1 or any(name not in one for one in found):
            raise InputError(
                f"'{name}' is not the same in all runs ({len(shapes)} shapes)",
                expected="the same names and shapes each time",
            )
        values[name] = np.stack([np.asarray(one[name], dtype=np.float64) for one in found])
        bad = np.flatnonzero(~np.isfinite(values[name].reshape(runs, -1)).all(axis=1))
        if bad.size:
            raise InputError(
                f"'{name}' is not finite in {bad.size} runs, the first is run {bad[0]}",
                expected="finite numbers",
            )
    return MonteCarloResult(values, seed)


def _one_run(experiment: Experiment, seed: int, run: int) -> dict[str, FloatArray]:
    rng = np.random.default_rng([seed, run])
    return {k: np.asarray(v, dtype=np.float64) for k, v in experiment(rng).items()}
