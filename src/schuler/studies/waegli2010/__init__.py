"""Waegli, Skaloud, Guerrier, Parés, Colomina 2010: noise of redundant MEMS-IMUs.

What is done with four IMUs stands in `fusion`, with the series of one gyro in `series`.
"""

from schuler.studies.experiment import Experiment, Item, Repetitions
from schuler.studies.waegli2010 import arithmetic, series, series_items

PAPER = series.PAPER

EXPERIMENTS = (
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
        repetitions=Repetitions(3, 20),
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
                series_items.whiteness,
                ("E-000-12",),
            ),
            Item(
                "Fig. 12",
                "Volatility by GARCH",
                "residuals and errors give the same volatility",
                series_items.volatility,
            ),
        ),
        repetitions=Repetitions(6, 40),
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
                series_items.tests,
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
                series_items.recording,
            ),
        ),
        repetitions=Repetitions(2, 6),
        recordings=("adis16405-static",),
    ),
)
"""All that is done again of this paper."""
