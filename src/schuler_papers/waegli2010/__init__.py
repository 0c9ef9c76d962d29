"""Waegli, Skaloud, Guerrier, Parés, Colomina 2010: noise of redundant MEMS-IMUs.

What is done with four IMUs stands in `fusion`, with the series of one gyro in `series`.
"""

from schuler_papers.experiment import Experiment, Item, Repetitions
from schuler_papers.waegli2010 import (
    arithmetic,
    board,
    fusion,
    fusion_items,
    residual_items,
    series,
    series_items,
    systems,
    volatility_items,
)

PAPER = series.PAPER

EXPERIMENTS = (
    Experiment(
        PAPER,
        "systems",
        "Four IMUs and GNSS through outages, five ways",
        systems.run,
        items=(
            Item(
                "Figs. 1-3",
                "Synthetic, extended, constrained integration; system level",
                "the synthetic IMU is simple and sub-optimal, the others are optimal",
                systems.figures_1_to_3,
            ),
            Item(
                "Fig. 4",
                "Four IMUs on a tetrahedron",
                "a regular tetrahedron with a reference IMU",
                systems.figure_4,
            ),
        ),
        repetitions=Repetitions(4, 40),
    ),
    Experiment(
        PAPER,
        "noise",
        "Four gyros of unequal noise, one biased",
        fusion.run_noise,
        items=(
            Item(
                "eq. (1), Fig. 5",
                "Noise of one and of the mean of four",
                "four sensors halve the noise: 48.6 % measured",
                fusion_items.figure_5,
                ("E-000-11",),
            ),
            Item(
                "Fig. 6",
                "A biased, noisy sensor",
                "MTi 14 is noisier, and its bias enters the synthetic IMU",
                fusion_items.figure_6,
                ("E-000-16",),
            ),
            Item(
                "eq. (12), Fig. 13",
                "Weighted synthetic IMU",
                "weights reduce noise by 14.6 % more, 56.2 % in all",
                fusion_items.figure_13,
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "weights",
        "Weights when one sensor is bad",
        fusion.run_weights,
        items=(
            Item(
                "eq. (12), weights",
                "Whose variance do residuals show?",
                "σ² of each sensor is estimated from its residuals",
                fusion_items.weights,
                ("E-000-11",),
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "volatility",
        "Averaged volatilities of constant noise and of a step",
        fusion.run_volatility,
        items=(
            Item(
                "eqs. (2)-(3), Fig. 7",
                "Averaged volatility by window",
                "longer windows are smoother",
                volatility_items.figure_7,
                ("E-000-1", "E-000-2"),
            ),
            Item(
                "eq. (4), Fig. 8",
                "Residuals against errors",
                "noise from residuals is underestimated; agreement is a coincidence",
                volatility_items.figure_8,
                ("E-000-3",),
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "arma",
        "ARMA(2,2) of Table 1 with independent innovations",
        series.run_arma,
        items=(
            Item(
                "Table 1",
                "ARMA(2,2) of a gyro's x axis",
                "all but the constant are significant",
                series_items.table_1,
            ),
            Item(
                "eqs. (8)-(11)",
                "Asymptotic normality",
                "estimates are normal around the truth",
                series_items.asymptotics,
                ("E-000-6",),
            ),
        ),
        repetitions=Repetitions(8, 100),
    ),
    Experiment(
        PAPER,
        "order",
        "Order of Table 1's model by AIC and BIC",
        series.run_order,
        items=(
            Item("sec. 5, order", "Choice of p and q", "AIC chooses ARMA(2,2)", series_items.order),
        ),
        repetitions=Repetitions(2, 20),
    ),
    Experiment(
        PAPER,
        "garch",
        "ARMA of Table 1 with GARCH innovations of Table 2",
        series.run_garch,
        items=(
            Item(
                "Table 2, eq. (7)",
                "GARCH(1,1) of a gyro's z axis",
                "all but α₀ are significant",
                series_items.table_2,
                ("E-000-9",),
            ),
            Item(
                "Figs. 9-11",
                "Signal and ARMA residual: correlation and Allan variance",
                "the residual of the ARMA model is distributed randomly",
                residual_items.whiteness,
                ("E-000-12",),
            ),
            Item(
                "Fig. 12",
                "Volatility by GARCH",
                "residuals and errors give the same volatility",
                series_items.volatility,
            ),
        ),
        repetitions=Repetitions(4, 40),
    ),
    Experiment(
        PAPER,
        "one-varies",
        "One gyro of four varies",
        fusion.run_one_varies,
        items=(
            Item(
                "Fig. 14",
                "GARCH against averaged volatility",
                "the averaged volatility is coarser and pools all sensors",
                volatility_items.figure_14,
            ),
            Item(
                "Table 3",
                "The two methods compared",
                "simple and robustifiable against fine and costly",
                volatility_items.table_3,
            ),
        ),
        repetitions=Repetitions(2, 20),
    ),
    Experiment(
        PAPER,
        "table-4",
        "One axis gets noisier",
        fusion.run_table_4,
        items=(
            Item(
                "Table 4, eq. (13)",
                "Synthetic and weighted IMU when one sensor gets noisier",
                "the weighted IMU is hardly affected",
                fusion_items.table_4,
            ),
        ),
        repetitions=Repetitions(2, 20),
    ),
    Experiment(
        PAPER,
        "tests",
        "Size and power of the tests",
        series.run_tests,
        items=(
            Item(
                "eqs. (5)-(6), ARCH-LM",
                "Whiteness, unpredictability, changing variance",
                "a white residual is unpredictable; Var[Z] = 1 selects the order",
                residual_items.tests,
                ("E-000-8", "E-000-12"),
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
                "E-000-4",
                "Percentages of the text",
                "48.6 %, 14.6 %, 56.2 %, 70.2 %",
                arithmetic.percentages,
            ),
            Item(
                "E-000-5",
                "More than the half of theory",
                "56 % is more than theory provides",
                arithmetic.more_than_half,
            ),
            Item(
                "E-000-9",
                "The quoted variance equation",
                "σ² = 0.0175 x² + 0.982 σ²",
                arithmetic.volatility_text,
            ),
            Item(
                "E-000-10",
                "The quoted ARMA equation",
                "1.67, -0.67, -1.09, 0.16",
                arithmetic.rounded_text,
            ),
            Item(
                "E-000-11",
                "Residuals mistaken for errors",
                "residuals show each sensor's variance; sensors are independent",
                arithmetic.mixing,
            ),
            Item(
                "E-000-13",
                "Conclusions",
                "noise reduction up to 100 %",
                arithmetic.conclusions,
                ("E-000-14", "E-000-16", "E-000-7", "E-000-15"),
            ),
        ),
    ),
    Experiment(
        PAPER,
        "adis16405-series",
        "ARMA and GARCH of six recordings of an ADIS16405",
        series.run_recording,
        items=(
            Item(
                "Figs. 9-12 on ADIS16405",
                "A real gyro at rest",
                "as in figures 9 to 12",
                residual_items.recording,
            ),
        ),
        repetitions=Repetitions(1, 6),
        recordings=("adis16405-static",),
    ),
    Experiment(
        PAPER,
        "mimu8-at-rest",
        "Eight gyros of one board at rest",
        board.run_recording,
        items=(
            Item(
                "Figs. 5, 13 on MIMU board",
                "Two, four and eight real gyros",
                "as in figures 5 and 13",
                board.recording,
            ),
        ),
        repetitions=Repetitions(1, 3),
        recordings=("mimu8-array",),
    ),
)
"""All that is done again of this paper."""
