"""Waegli, Skaloud, Guerrier, Parés, Colomina 2010: noise of redundant MEMS-IMUs.

What is done with four IMUs stands in `fusion`, with the series of one gyro in `series`; what is
printed, in `paper.yaml`.
"""

from schuler_papers.judging import load_experiments

EXPERIMENTS = load_experiments(__name__)
"""All that is done again of this paper."""
