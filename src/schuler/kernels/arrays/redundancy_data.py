"""What following redundant axes works on: the axes, how they are watched, what is remembered.

M axes in some units, n samples in blocks, J time constants of smoothed residuals.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.structure_fields import (
    ArrayField,
    Counter,
    Flags,
    Matrix,
    Matrix3,
    Number,
    Places,
    Vector,
    reals,
    seen,
)
from schuler.kernels.structures import carve, size_of, structure
from schuler.kernels.types import FloatArray

Rows3 = Annotated[FloatArray, reals(None, 3)]
Columns3 = Annotated[FloatArray, reals(3, None)]
Seen = Annotated[FloatArray, seen(reals(None))]
SeenMatrix = Annotated[FloatArray, seen(reals(None, None))]
ShortNumbers = Annotated[NDArray[np.int16], ArrayField(np.dtype(np.int16), (None,))]


@structure
class Plan:
    """The axes in use put close together, so that a sample costs no look-up; see `arrange`.

    active (M,): the axes in use, in order; bounds (units + 1,): where each unit begins among
    them; h, pi (3, M): columns of A' and of (A'PA)^-1 A'P; weight, testing (M,): 1/s, and 1/q,
    zero where the residual is always zero; inverse (3, 3): covariance of the fused vector;
    unit_testing (units, 3, 3): Q_TT^-1, zero where a unit cannot be tested. `count`: axes in use,
    -1 where they leave a direction unmeasured.
    """

    active: Places
    bounds: Places
    h: Columns3
    pi: Columns3
    weight: Vector
    testing: Vector
    inverse: Matrix3
    unit_testing: Annotated[FloatArray, reals(None, 3, 3)]
    count: Counter

    @classmethod
    def empty(cls, total: int, units: int) -> Plan:
        """Room for `total` axes in so many units."""
        return cls(
            active=np.zeros(total, np.int64),
            bounds=np.zeros(units + 1, np.int64),
            h=np.zeros((3, total)),
            pi=np.zeros((3, total)),
            weight=np.zeros(total),
            testing=np.zeros(total),
            inverse=np.zeros((3, 3)),
            unit_testing=np.zeros((units, 3, 3)),
            count=np.full(1, -1),
        )


@structure
class RedundantAxes:
    """What was measured, and along what.

    measurements (n, M): NaN where missing; arm_tensor (n, 9) or (0, 9): [dw/dt x] + [w x][w x],
    row by row, 1/s² (empty: no lever arms); arm (9, M): h_b l_c of each axis, times the tensor
    what rotation adds to it; extra (n,) or (0,): variance besides the noise, the same for all
    axes, that does not average out; axes (M, 3): unit rows; unit (M,): not decreasing from zero;
    given (blocks, M) or (0, M): variances to use in each block (empty: estimated on line).
    """

    measurements: SeenMatrix
    arm_tensor: SeenMatrix
    arm: SeenMatrix
    extra: Seen
    axes: Annotated[FloatArray, seen(reals(None, 3))]
    unit: Annotated[NDArray[np.int64], ArrayField(np.dtype(np.int64), (None,), seen=True)]
    given: SeenMatrix


@structure
class Tuning:
    """How the axes are followed.

    block: samples; adaptation, common: share of a block in the estimated variances, and in their
    common level; scatter, floor: for `working_variances`, the floor a share of the median; clip:
    largest f²/q that counts as it is; bias_gain: share of a block in the differences of the biases
    (zero: they stay); bias_samples: samples behind them at the beginning (infinite: known);
    wander: variance of slow wander of a bias that is no fault; spike: F of one axis in one sample
    beyond which it is not used; smoothing (J,): share of a block in the smoothed residuals (empty:
    no faults are looked for); axis_threshold, unit_threshold (J,): F beyond which an axis or a
    unit is taken out; unit_margin: by how much the F of a unit must exceed that of its worst axis
    to blame the unit; factor_gain: share of a block in the calibration factors; learning: blocks
    at the beginning in which nothing is taken out; readmission: F of an axis taken out below which
    it behaves; recall: blocks within which what was taken out comes back when the others turn out
    no better.
    """

    block: int
    adaptation: float
    common: float
    scatter: float
    clip: float
    floor: float
    bias_gain: float
    bias_samples: float
    wander: float
    spike: float
    smoothing: Vector
    axis_threshold: Vector
    unit_threshold: Vector
    unit_margin: float
    factor_gain: float
    learning: int
    readmission: float
    recall: int


@structure
class Remembered:
    """What goes from block to block.

    bias, variance (M,): differences of the biases, estimated s; factor (J,): calibration of the
    smoothed residuals, at least one; status (M,): 0 in use, 1 taken out by itself, 2 with its unit;
    patience (M,): blocks that an axis has to behave, doubled each time; quiet, taken (M,): blocks
    that it has, block in which it was taken out; use (M,): in this block; gauged (M,): those of
    the gauge of the biases; average (J, M): smoothed residuals; extra_average (J,): smoothed
    variance of motion; level: least variance; mean_extra: of the last block; unresolved: the axes
    disagree in a way that blames nobody; events so far; sample: the last one of the block; seen:
    samples before the first block.
    """

    bias: Vector
    variance: Vector
    factor: Vector
    status: Places
    patience: Places
    quiet: Places
    taken: Places
    use: Flags
    gauged: Flags
    average: Matrix
    extra_average: Vector
    level: Number
    mean_extra: Number
    unresolved: Flags
    events: Counter
    sample: Counter
    seen: Number

    @classmethod
    def begin(
        cls, bias: FloatArray, variance: FloatArray, time_constants: int, patience: int
    ) -> Remembered:
        """Before the first block, with these differences of the biases and variances."""
        total = bias.size
        return cls(
            bias=bias,
            variance=variance,
            factor=np.ones(time_constants),
            status=np.zeros(total, np.int64),
            patience=np.full(total, patience, dtype=np.int64),
            quiet=np.zeros(total, np.int64),
            taken=np.zeros(total, np.int64),
            use=np.zeros(total, np.bool_),
            gauged=np.zeros(total, np.bool_),
            average=np.zeros((time_constants, total)),
            extra_average=np.zeros(time_constants),
            level=np.zeros(1),
            mean_extra=np.zeros(1),
            unresolved=np.zeros(1, np.bool_),
            events=np.zeros(1, np.int64),
            sample=np.zeros(1, np.int64),
            seen=np.zeros(1),
        )


@structure
class FollowedOutputs:
    """What is written.

    fused (n, 3): NaN where the axes that remain leave a direction unmeasured; covariance
    (blocks, 6): xx, xy, xz, yy, yz, zz; variances (blocks, M): s as used; usage (blocks, M): 0
    used, 1 and 2 as status, 3 missing; freedom (blocks,): degrees of freedom of D; statistic,
    axis_statistic, unit_statistic (n,): D, largest F of an axis and of a unit, NaN where some axis
    is missing in this sample alone, with the suspects; smoothed (blocks, J): largest F of an axis
    by smoothed residuals; events (e, 8): last sample of the block, kind, axis or unit, scale, F,
    threshold, size of the fault, other axis. Kinds: 0 axis out, 1 unit out, 2 axis back, 3 unit
    back, 4 axes (6 units) contradict one another and none can be blamed, 5 consistent again;
    events beyond the space are counted only.
    """

    fused: Rows3
    covariance: Annotated[FloatArray, reals(None, 6)]
    variances: Matrix
    usage: Annotated[NDArray[np.int8], ArrayField(np.dtype(np.int8), (None, None))]
    freedom: ShortNumbers
    statistic: Vector
    axis_statistic: Vector
    axis_suspect: ShortNumbers
    unit_statistic: Vector
    unit_suspect: ShortNumbers
    smoothed: Matrix
    events: Annotated[FloatArray, reals(None, 8)]


@structure
class BlockWork:
    """What a block writes and forgets.

    here, spare_use (M,): axes that deliver values, and those of one sample; y, f, f_spare, ratio:
    measurements, residuals, f²/q of the axes in use; sums, squares: over the block; means, excess,
    seen (M,): mean residual, sum of f²/q, samples; shares: of the block; trust, worst (M,); working
    (M,): variances as used; one (M,): equal weights; noise_share, spread, slow, peak (J,): what
    smoothing leaves of the variance of a sample, that with the biases, what motion and wander add,
    largest F; before (J, M): averages before anything was taken out.
    """

    here: Flags
    spare_use: Flags
    y: Vector
    f: Vector
    f_spare: Vector
    ratio: Vector
    sums: Vector
    squares: Vector
    means: Vector
    excess: Vector
    seen: Vector
    shares: Vector
    trust: Vector
    worst: Vector
    working: Vector
    one: Vector
    noise_share: Vector
    spread: Vector
    slow: Vector
    peak: Vector
    before: Matrix

    @classmethod
    def of(cls, total: int, tuning: Tuning) -> BlockWork:
        """Work for so many axes."""
        names = (
            "y", "f", "f_spare", "ratio", "sums", "squares", "means", "excess", "seen", "shares",
            "trust", "worst", "working", "one",
        )  # fmt: skip
        count = tuning.smoothing.size
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(names, (total,))
        shapes |= dict.fromkeys(("noise_share", "spread", "slow", "peak"), (count,))
        shapes["before"] = (count, total)
        views: Mapping[str, Any] = carve(shapes, np.zeros(size_of(shapes)))
        work = cls(np.zeros(total, np.bool_), np.zeros(total, np.bool_), **views)
        work.one[:] = 1.0
        work.noise_share[:] = tuning.smoothing / (2.0 - tuning.smoothing) / tuning.block
        return work


@structure
class Redundancy:
    """Redundant axes, how they are followed, what is remembered and written; three plans.

    The plan of the block, a spare one for what might be taken out, and one with equal weights
    for the gauge of the biases.
    """

    given: RedundantAxes
    tuning: Tuning
    memory: Remembered
    out: FollowedOutputs
    work: BlockWork
    plan: Plan
    spare: Plan
    gauge: Plan

    @classmethod
    def of(
        cls,
        given: RedundantAxes,
        units: int,
        tuning: Tuning,
        memory: Remembered,
        out: FollowedOutputs,
    ) -> Redundancy:
        """With room to work."""
        total = memory.bias.size
        plan, spare, gauge = (Plan.empty(total, units) for _ in range(3))
        work = BlockWork.of(total, tuning)
        return cls(given, tuning, memory, out, work, plan, spare, gauge)
