"""Waegli, Guerrier, Skaloud 2008: redundant MEMS-IMUs and GPS for sports.

The rides with their truth stand in `rides`, what is run on them in `runs`, noise and faults of the
sensors in `sensors`, and what it comes to beside the printed numbers in `items` and `sensor_items`.
"""

from schuler_papers.experiment import Experiment, Item, Repetitions
from schuler_papers.waegli2008 import items, runs, sensor_items, sensors
from schuler_papers.waegli2008.rides import PAPER

EXPERIMENTS = (
    Experiment(
        PAPER,
        "noise",
        "Four equal gyro triads at rest",
        sensors.run_noise,
        items=(
            Item(
                "Fig. 5, eq. (1)",
                "Noise of one and of four",
                "noise reduction of 100 %, 92 % by experiment",
                sensor_items.figure_5,
                ("E-002-1",),
            ),
            Item("Fig. 6", "Normality", "the difference is quasi-Gaussian", sensor_items.figure_6),
        ),
        repetitions=Repetitions(4, 40),
    ),
    Experiment(
        PAPER,
        "parity",
        "Faults in parity space",
        sensors.run_parity,
        items=(
            Item(
                "eqs. (2), (3)",
                "Decision variable and threshold",
                "T = 0.0155 rad²/s² for 5 % false alarms",
                sensor_items.thresholds,
                ("E-002-3", "E-002-4"),
            ),
            Item(
                "Fig. 7",
                "Best threshold for 3.5 sigma faults",
                "76 % of the faults are missed, a false alarm for every third",
                sensor_items.figure_7,
                ("E-002-4",),
            ),
        ),
        repetitions=Repetitions(3, 20),
    ),
    Experiment(
        PAPER,
        "misalignment",
        "Attitude between IMUs from a minute of riding",
        sensors.run_misalignment,
        items=(
            Item(
                "eq. (12)",
                "Relative alignment",
                "known to 0.5 deg by a filter with the attitude as measurement",
                sensor_items.equation_12,
                ("E-002-7",),
            ),
        ),
        repetitions=Repetitions(6, 60),
    ),
    Experiment(
        PAPER,
        "ranks",
        "Observability matrix",
        sensor_items.run_ranks,
        items=(
            Item(
                "eq. (13)",
                "Rank of the observability matrix",
                "15 states: 15, 33 states: 15",
                sensor_items.equation_13,
                ("E-002-14",),
            ),
            Item(
                "arithmetic",
                "What the printed numbers imply",
                "30, 46, 61 % less; maxima less by a factor 2",
                sensor_items.arithmetic,
                (
                    "E-002-2",
                    "E-002-5",
                    "E-002-6",
                    "E-002-9",
                    "E-002-10",
                    "E-002-12",
                    "E-002-13",
                ),
            ),
        ),
    ),
    Experiment(
        PAPER,
        "ski",
        "Two aligned IMUs on a skier",
        runs.run_ski,
        items=(
            Item(
                "Table 1",
                "Attitude with two IMUs against one",
                "20 to 30 % less, position and velocity hardly changed",
                items.table_1,
                ("E-002-8", "E-002-14"),
            ),
            Item(
                "Figs. 12, 13",
                "Bias of the synthetic IMU",
                "it is the average of the biases of the IMUs",
                items.figure_13,
            ),
        ),
        repetitions=Repetitions(3, 30),
    ),
    Experiment(
        PAPER,
        "motorcycle",
        "Four IMUs on a tetrahedron, on a motorcycle",
        runs.run_motorcycle,
        items=(
            Item(
                "Table 2, Fig. 14",
                "Accuracy with two receivers",
                "attitude below 1 deg, whatever the receiver",
                items.table_2,
                ("E-002-11",),
            ),
            Item(
                "Table 3",
                "Four IMUs against one",
                "30 % less by fusing, 46 % less by the extended filter",
                items.table_3,
                ("E-002-9", "E-002-14"),
            ),
            Item("Fig. 15", "Attitude error", "peaks are smoothed out", items.figure_15),
            Item(
                "Fig. 16",
                "Biases of single sensors",
                "those of the extended filter do not match those found one by one",
                items.figure_16,
            ),
            Item(
                "Fig. 17",
                "Correlation of the biases",
                "biases are only weakly correlated, 0.2 to 0.3",
                items.figure_17,
            ),
            Item(
                "Figs. 1-4, 8-11, eqs. (4)-(11)",
                "Levels of redundancy and mechanizations",
                "redundancy at system level is not attractive; three mechanizations",
                items.levels,
            ),
        ),
        repetitions=Repetitions(3, 30),
    ),
    Experiment(
        PAPER,
        "unequal",
        "One IMU in four with biases ten times as large",
        runs.run_unequal,
        items=(
            Item(
                "Table 3, extended",
                "What the extended filter is worth",
                "it is better as it estimates the biases one by one",
                items.unequal,
                ("E-002-14",),
            ),
        ),
        repetitions=Repetitions(3, 30),
    ),
)
"""All that is done again of this paper."""
