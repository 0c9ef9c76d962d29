"""Quinchia, Falco, Falletti, Dovis, Ferrer 2013: error models of a MEMS IMU through GPS outages.

Figures 1 to 3, 7 to 9 and 19 are block diagrams and photographs; the working components are the
mechanization, the closed loop and the wavelet filter bank of the library.
"""

from schuler_papers.experiment import Experiment, Item, Repetitions
from schuler_papers.quinchia2013 import (
    arithmetic,
    drive,
    judging,
    laws,
    matrices,
    outages,
    recordings,
    static,
)
from schuler_papers.quinchia2013.sensor import PAPER

EXPERIMENTS = (
    Experiment(
        PAPER,
        "laws",
        "Every noise alone",
        laws.run,
        items=(
            Item(
                "Fig. 4, eq. (11)",
                "Autocorrelation of Gauss-Markov noise",
                "it decays exponentially",
                laws.figure_4,
                slips=("E-004-1",),
            ),
            Item(
                "Fig. 5, eq. (12)",
                "Densities of noises",
                "each noise has its slope in the density",
                laws.figure_5,
            ),
            Item(
                "Fig. 6, eqs. (13)-(14)",
                "Allan deviations of noises",
                "each noise has its slope in the Allan deviation",
                laws.figure_6,
            ),
        ),
        repetitions=Repetitions(1, 5),
    ),
    Experiment(
        PAPER,
        "matrices",
        "Single steps of the filter's model",
        matrices.run,
        items=(
            Item(
                "eqs. (1)-(4)",
                "Gauss-Markov noise in steps",
                "transition 1 - dt/Tc with the exact variance",
                matrices.euler,
                slips=("E-004-2",),
            ),
            Item(
                "eqs. (5)-(8)",
                "White noise, Gauss-Markov and random walk together",
                "one noise drives both states",
                matrices.one_noise,
                slips=("E-004-3",),
            ),
            Item(
                "eqs. (9)-(10), eqs. (31)-(36)",
                "AR in states, the 27-state model",
                "companion form, the newest sample is the output",
                matrices.companion,
            ),
            Item(
                "eqs. (21)-(30)",
                "Noise covariance of the 18-state model",
                "N²/dt, variances of states and K² dt in one Q",
                matrices.noise_matrix,
                slips=("E-004-6",),
            ),
            Item(
                "Table 8, eqs. (19)-(20)",
                "States of the models",
                "15, 18 and 27 states",
                matrices.table_8,
            ),
            Item(
                "E-004-10",
                "AR(3) as printed",
                "coefficients with three decimals",
                matrices.rounded_roots,
            ),
        ),
        repetitions=Repetitions(1, 5),
    ),
    Experiment(
        PAPER,
        "static",
        "The static record of the laboratory",
        static.run,
        items=(
            Item(
                "Table 2",
                "AR models after de-noising",
                "six levels, soft SURE thresholds, Burg",
                static.table_2,
            ),
            Item(
                "E-004-8",
                "Levels of table 2",
                "six levels for all sensors",
                static.caption_of_table_2,
            ),
            Item(
                "Table 3, Figs. 12-14",
                "Parameters by the spectrum",
                "N, B and K from slopes of the density",
                static.table_3,
                slips=("E-004-9",),
            ),
            Item(
                "Table 4, Figs. 15-16",
                "Parameters by the Allan variance",
                "N, B and K from slopes of the Allan deviation",
                static.table_4,
                slips=("E-004-9",),
            ),
            Item(
                "Tables 3-4",
                "Spectrum against Allan variance",
                "both agree",
                static.agreement,
            ),
            Item(
                "Table 5",
                "Times of the flat parts",
                "correlation times of the bias instability",
                static.table_5,
                slips=("E-004-5",),
            ),
            Item(
                "Fig. 17",
                "Allan deviation after de-noising",
                "short times are attenuated, long ones are not",
                static.figure_17,
            ),
        ),
        repetitions=Repetitions(1, 20),
    ),
    Experiment(
        PAPER,
        "correlation",
        "The device's own filter, and what de-noising leaves",
        static.run_correlation,
        items=(
            Item(
                "Figs. 10-11",
                "Autocorrelations raw and de-noised",
                "white raw; after six levels not that of a Gauss-Markov noise",
                static.figures_10_and_11,
            ),
            Item(
                "Table 5, standard deviations",
                "Sample deviations",
                "0.0045 to 0.0068",
                static.standard_deviations,
            ),
        ),
        repetitions=Repetitions(1, 20),
    ),
    Experiment(
        PAPER,
        "outages",
        "Two drives, seven outages, every error model",
        outages.run,
        items=(
            Item(
                "Figs. 20, 23",
                "The drives",
                "17.3 and 15.05 min with three and four outages",
                judging.trajectories,
            ),
            Item("Fig. 21", "Outage 1", "18AVWD has the smallest error", judging.figure_21),
            Item("Fig. 22", "Outage 2", "18AVWD is better than AR and AV", judging.figure_22),
            Item("Fig. 24", "Outage 5", "18AVWD has the smallest error", judging.figure_24),
            Item("Fig. 25", "Outage 7", "18AVWD has the smallest error", judging.figure_25),
            Item("Table 9", "Errors of the first drive", "by outage and model", judging.table_9),
            Item("Table 10", "Errors of the second drive", "by outage and model", judging.table_10),
            Item(
                "Fig. 26",
                "Largest and mean errors of all outages",
                "18AVWD is 26 to 51 % better than the others",
                judging.figure_26,
            ),
            Item(
                "Tables 9-10, order of the models",
                "AV, AR(1), AR(3) by the error after 60 s",
                "AV models are better than AR models",
                judging.ordering,
            ),
            Item(
                "E-004-7, outages",
                "Claimed against real errors",
                "not looked at",
                judging.honesty,
                slips=("E-004-7",),
            ),
            Item(
                "E-004-11",
                "Why AR models do worse",
                "a rough autocorrelation",
                judging.mechanism,
            ),
            Item(
                "E-004-14",
                "What de-noising gives",
                "26 % over 18AV",
                judging.denoising,
            ),
        ),
        repetitions=Repetitions(3, 50),
    ),
    Experiment(
        PAPER,
        "denoised",
        "The same outages without an error model, de-noised to 0, 3 and 7 levels",
        outages.run_denoised,
        items=(
            Item(
                "Table 6, Fig. 18",
                "Largest errors by level of decomposition",
                "seven levels are 4.3 % better",
                judging.table_6,
                slips=("E-004-14",),
            ),
            Item("Table 7", "Levels by sensor", "seven, six for y and z", judging.table_7),
        ),
        repetitions=Repetitions(2, 20),
    ),
    Experiment(
        PAPER,
        "recordings",
        "Six static records of an ADIS16405",
        recordings.run,
        items=(
            Item(
                "Table 2, recordings",
                "AR models after de-noising, of a real sensor",
                "the coefficients describe the sensor",
                recordings.table_2,
                slips=("E-004-8",),
            ),
        ),
        repetitions=Repetitions(2, 6),
        recordings=(recordings.FOLDER,),
    ),
    Experiment(
        PAPER,
        "arithmetic",
        "The paper's own numbers added up again",
        arithmetic.run,
        items=(
            Item(
                "Tables 9-10, percentages",
                "The eight percentages of the text",
                "18AVWD is better by 25 to 51 %",
                arithmetic.percentages,
                slips=("E-004-17",),
            ),
            Item(
                "E-004-15",
                "What seven outages can tell",
                "18AV is better than 15AV in most situations",
                arithmetic.significance,
            ),
            Item(
                "Table 6, sums",
                "Table 6 added up",
                "4.3 % better with seven levels",
                arithmetic.table_6_sums,
                slips=("E-004-17",),
            ),
            Item(
                "E-004-16",
                "Table 3 within the intervals of table 4",
                "most are within",
                arithmetic.tables_3_and_4,
            ),
            Item(
                "eqs. (15)-(18), Table 1",
                "Small sums",
                "32 %, 44.533 deg/h, 14.16 %, band limits",
                arithmetic.small_sums,
                slips=("E-004-4", "E-004-12", "E-004-13"),
            ),
            Item(
                "E-004-9",
                "Crossing of N and K",
                "a plateau of bias instability",
                arithmetic.crossings,
            ),
            Item(
                "E-004-7",
                "Gauss-Markov noise through a plateau",
                "sigma is the plateau, Tc its time",
                arithmetic.plateau,
            ),
            Item(
                "E-004-5, E-004-18, E-004-19, Figs. 1-3, Figs. 7-9, Fig. 19",
                "Words and diagrams",
                "as printed",
                arithmetic.words,
                slips=("E-004-5", "E-004-18", "E-004-19"),
            ),
        ),
    ),
    Experiment(
        PAPER,
        "rtk-drive",
        "Seven outages on a drive with RTK",
        drive.run,
        items=(
            Item(
                "Tables 9-10 on a drive with RTK",
                "What models cannot give, and what else does",
                "the error model decides how large errors in outages are",
                drive.outages,
            ),
        ),
        repetitions=Repetitions(0, 1),
        recordings=("rtk-drive",),
    ),
)
