"""Tamazin, Noureldin, Korenberg 2013: AR models by three methods against fast orthogonal search.

Figures 3 and 4 are a filter A(z) and its lattice; both are run, and their outputs compared.
"""

from schuler_papers.experiment import Experiment, Item, Repetitions
from schuler_papers.tamazin2013 import (
    arithmetic,
    claims,
    correlation,
    estimators,
    predictors,
    tables,
)

PAPER = predictors.PAPER

EXPERIMENTS = (
    Experiment(
        PAPER,
        "correlation",
        "Autocorrelations of one Gauss-Markov noise and of two",
        correlation.run,
        items=(
            Item(
                "Fig. 1",
                "Autocorrelation of first-order Gauss-Markov noise",
                "it decays exponentially, to 1/e at the correlation time",
                correlation.figure_1,
            ),
            Item(
                "Fig. 2",
                "Autocorrelation of a MEMS accelerometer",
                "it is not that of a first-order process",
                correlation.figure_2,
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "lattice",
        "AR(3) with poles near one by three methods",
        estimators.run_long,
        items=(
            Item(
                "Figs. 3-4, eqs. (1)-(13)",
                "AR filter, lattice, Yule-Walker, covariance, Burg",
                "all methods lead to about the same parameters in large samples",
                estimators.figures_3_and_4,
            ),
            Item(
                "E-003-9", "Slips in equations (5), (9f), (13)", "as printed", estimators.energies
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "signal",
        "One hour of accelerometer and gyro at 200 Hz",
        correlation.run_signal,
        items=(
            Item(
                "Fig. 5",
                "Raw accelerometer and gyro",
                "an hour of static data of a Crossbow CC-300 at 200 Hz",
                correlation.figure_5,
            ),
        ),
        repetitions=Repetitions(2, 20),
    ),
    Experiment(
        PAPER,
        "accelerometer",
        "Predictors of the accelerometer on equal data",
        predictors.run_accelerometer,
        items=(
            Item(
                "Table 1",
                "Errors of the accelerometer's models",
                "FOS on raw data beats all others on de-noised data, by up to four orders",
                tables.table_1,
                slips=("E-003-1", "E-003-2", "E-003-11"),
            ),
            Item(
                "Fig. 6",
                "Error by order, accelerometer",
                "FOS needs order 3 or 4, Burg and covariance 7 or 8",
                tables.figure_6,
                slips=("E-003-1",),
            ),
            Item(
                "eq. (29)",
                "The nine-term model",
                "FOS finds it in raw data",
                tables.equation_29,
                slips=("E-003-1",),
            ),
            Item(
                "E-003-1",
                "The central claim",
                "FOS on raw data is better than any method on de-noised data",
                claims.central_claim,
                slips=("E-003-11",),
            ),
            Item(
                "E-003-6",
                "Yule-Walker has one error at all orders",
                "5·10⁻⁹ at order 1 and at order 10",
                claims.offset_left_in,
            ),
            Item(
                "E-003-12",
                "Computing time",
                "FOS is faster",
                claims.time_column,
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "gyro",
        "Predictors of the gyro on equal data",
        predictors.run_gyro,
        items=(
            Item(
                "Table 2",
                "Errors of the gyro's models",
                "FOS on raw data beats all others on de-noised data",
                tables.table_2,
                slips=("E-003-1", "E-003-2", "E-003-11"),
            ),
            Item(
                "Fig. 7",
                "Error by order, gyro",
                "FOS reaches the smallest error with the lowest order",
                tables.figure_7,
                slips=("E-003-1",),
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "arithmetic",
        "What the printed numbers imply",
        arithmetic.run,
        items=(
            Item(
                "Tables 1-2, position error",
                "Position after one hour",
                "the error of a model in metres",
                arithmetic.positions,
            ),
            Item(
                "E-003-5",
                "The position column's law",
                "a prediction error acts like a bias on a flat earth",
                arithmetic.interpretation,
            ),
            Item(
                "E-003-4",
                "The unit of Table 2",
                "(deg/h)²",
                arithmetic.gyro_unit,
                slips=("E-003-1",),
            ),
            Item(
                "E-003-10",
                "Equation (29) as printed",
                "a model for filters on mobile devices",
                arithmetic.printed_model,
            ),
            Item(
                "E-003-8",
                "Band of four wavelet levels",
                "4 levels limit 200 Hz data to 12.5 Hz",
                arithmetic.band_limit,
            ),
        ),
    ),
    Experiment(
        PAPER,
        "short-records",
        "Stability of models of short records",
        estimators.run_short,
        items=(
            Item(
                "E-003-7",
                "Which method is stable",
                "Yule-Walker does not guarantee a stable model",
                estimators.stability,
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "sparse",
        "Searches for known terms",
        estimators.run_sparse,
        items=(
            Item(
                "eqs. (14)-(28)",
                "Fast orthogonal search",
                "it selects the true terms; adding products improves the model",
                estimators.search,
                slips=("E-003-11",),
            ),
            Item(
                "E-003-3",
                "An error of 2·10⁻¹⁶",
                "FOS with products reaches it",
                estimators.cancellation,
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "adis16405-predictors",
        "Predictors on six recordings of an ADIS16405",
        predictors.run_recording,
        items=(
            Item(
                "Table 1 on ADIS16405",
                "The same comparison on a real accelerometer",
                "as in table 1",
                claims.recording,
                slips=("E-003-1", "E-003-10"),
            ),
        ),
        repetitions=Repetitions(2, 6),
        recordings=("adis16405-static",),
    ),
    Experiment(
        PAPER,
        "adis16405-correlation",
        "Autocorrelation of six recordings of an ADIS16405",
        correlation.run_recording,
        items=(
            Item(
                "Fig. 2 on ADIS16405",
                "Autocorrelation of a real accelerometer",
                "as in figure 2",
                correlation.figure_2_recording,
            ),
        ),
        repetitions=Repetitions(2, 6),
        recordings=("adis16405-static",),
    ),
)
"""All that is done again of this paper."""
