"""The four papers as experiments on twins with known truth: what is printed beside what comes out.

How a paper is written down
---------------------------
A package a paper, named as in `registry.PAPERS`. What is printed is data: ``paper.yaml`` lists the
experiments, each with the tables, figures, equations and slips that its results serve, and for each
of these the rows and tables: printed values, units, bands. What is run is Python: the function
``run(seed, size) -> Numbers`` of an experiment, and the judge ``(results, size) -> Found`` of an
item, which names what came out::

    - name: noise                       # paper.yaml
      title: Four IMUs at rest
      run: sensors.run_noise
      times: [3, 40]                    # seeds of the quick and of the full size
      items:
        - label: Fig. 5
          title: Noise of one and of four
          claim: four sensors halve the noise
          judge: sensors.figure_5       # left out: what the runs returned, as it is
          rows:
            - {is: reduction, of: noise reduction, printed: 0.486, band: [0.46, 0.50]}

    def run_noise(seed: int, size: Size) -> Numbers:      # sensors.py
        rng = generator(seed, "waegli2010", "noise")
        ...                             # only names of `schuler` itself
        return numbers(single=0.0201, synthetic=0.0103)

    def figure_5(results: Results, size: Size) -> Found:
        ratio = 1.0 - stacked(results, "synthetic") / stacked(results, "single")
        return Found({"reduction": ratio}, panels=(Panel(...),))

What a row may say
------------------
``is`` (the name of the value; ``at`` picks from an array), ``of`` (the quantity in words),
``printed`` (a number, or words), ``derived`` (arithmetic of printed numbers), ``unit``; where ours
has to lie: ``band: [low, high]``, ``near: [value, slack]``, or from the printed number ``within``
(relative) or ``around`` (absolute), else a band of that name that the judge computed; who says so:
``from`` spec, theory or frozen, with a ``note``; ``errors`` (standard errors that widen the band);
``error`` (standard deviation of the printed number); ``kind`` arithmetic or setting; ``against``
(the band contradicts the words); ``proof`` (one that the judge ran) or ``identity`` (the sentence
that the row's own arithmetic proves); ``because``, ``slip``;
``quick`` and ``full`` (what differs by size), ``only`` (one size); ``for`` and ``each`` (many rows
at once). A table has ``lines``, ``columns`` and ``printed`` cell by cell as well; cells with a
``forecast`` (relative width) get their band from `benchmarks.forecast`: the mean of many draws, in
whose scatter a printed number may lie that is one draw.

Rules
-----
* Nobody writes a verdict: it follows from printed, ours, its standard error, band and proof
  (`outcome.Row.verdict`). "Wrong in the paper" needs a proof that ran and held.
* Functions stand at the top of a module: they are looked up by name in other processes.
* `Numbers` are plain float64 arrays by name, small enough to keep (below 1 MB). They are stored as
  npz and judged later, perhaps by another command, so a judge reads nothing else.
* The generator comes from `generator(seed, paper, experiment)`; nothing else is random, so that
  numbers do not depend on how the work is spread.
* Values stand in the unit in which the paper prints them.
* An experiment with ``recordings`` needs these folders of measured data; its function is called as
  ``run(seed, size, folder)``; without the data it is left out, and said so.
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
from schuler_papers.judging import Found
from schuler_papers.outcome import (
    VERDICTS,
    Band,
    Curve,
    Estimate,
    Outcome,
    Panel,
    Proof,
    Row,
    Sheet,
)
from schuler_papers.registry import PAPERS, Paper, experiments_of

__all__ = [
    "PAPERS",
    "VERDICTS",
    "Band",
    "Curve",
    "Estimate",
    "Experiment",
    "Found",
    "Item",
    "Numbers",
    "Outcome",
    "Panel",
    "Paper",
    "Proof",
    "Repetitions",
    "Results",
    "Row",
    "Sheet",
    "Size",
    "estimate",
    "experiments_of",
    "generator",
    "numbers",
    "stacked",
]
