"""The four papers as experiments on twins with known truth: what is printed beside what comes out.

How a paper is written down
---------------------------
One module (or package) a paper, named as in `registry.PAPERS`, with a tuple ``EXPERIMENTS``. An
`Experiment` is one unit of work, ``run(seed, size) -> Numbers``, that is repeated with other seeds
and whose results serve one or more `Item` s: a table, figure, equation or erratum of the paper.
Each item has a function ``judge(results, size) -> Outcome`` that sets what came out beside what is
printed::

    def _noise(seed: int, size: Size) -> Numbers:
        rng = generator(seed, "waegli2010", "noise")
        n = 6_000 if size == "quick" else 60_000
        ...                                      # only verbs of the public library
        return numbers(single=0.0201, synthetic=0.0103, curve=array)

    def _figure_5(results: Results, size: Size) -> Outcome:
        ratio = estimate(1.0 - stacked(results, "synthetic") / stacked(results, "single"))
        row = Row(
            "noise reduction of the synthetic IMU", ratio, printed=0.486,
            band=Band(0.46, 0.50, "spec"), verdict="reproduced",
        )
        return Outcome((row,), panels=(Panel(...),), notes=("one sentence of what it teaches",))

    EXPERIMENTS = (
        Experiment(
            "waegli2010", "noise", "Four IMUs at rest", _noise,
            items=(Item("Fig. 5", "Noise of one and of four", "four sensors halve it", _figure_5),),
            repetitions=Repetitions(quick=3, full=40),
        ),
    )

Rules
-----
* Functions stand at the top of a module: they are looked up by name in other processes.
* `Numbers` are plain float64 arrays by name (a scalar is an array without axes), small enough to
  keep (below 1 MB): curves are thinned before they are returned. They are stored as npz and judged
  later, perhaps by another command, so a judge reads nothing else.
* The generator comes from `generator(seed, paper, experiment)`; nothing else is random, so that
  numbers do not depend on how the work is spread.
* Values stand in the unit in which the paper prints them; `Row.unit` says which.
* A `Band` says where a value has to lie and who says so: "spec", "theory", or "frozen" (after the
  first full run; the note then gives the value that was measured). A row outside its band fails
  the run. Deterministic arithmetic (errata) has one repetition and no standard error.
* The verdict is about the paper: "reproduced", "reproduced in kind" (the effect, not the number),
  "cannot be expected" (`reason` says why), "wrong in the paper" (`reason` is the proof, `erratum`
  its label), or "beyond the paper" for what the library does better, with errors.
* An experiment with ``recordings=("adis16405-static",)`` needs these folders of measured data; its
  function is called as ``run(seed, size, folder)``; without the data it is left out, and said so.
"""

from schuler_papers.experiment import (
    Experiment,
    Item,
    Numbers,
    Repetitions,
    Results,
    Size,
    estimate,
    generator,
    numbers,
    stacked,
)
from schuler_papers.outcome import Band, Curve, Estimate, Outcome, Panel, Row, Verdict
from schuler_papers.registry import PAPERS, Paper, experiments_of

__all__ = [
    "PAPERS",
    "Band",
    "Curve",
    "Estimate",
    "Experiment",
    "Item",
    "Numbers",
    "Outcome",
    "Panel",
    "Paper",
    "Repetitions",
    "Results",
    "Row",
    "Size",
    "Verdict",
    "estimate",
    "experiments_of",
    "generator",
    "numbers",
    "stacked",
]
