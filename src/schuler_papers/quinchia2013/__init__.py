"""Quinchia, Falco, Falletti, Dovis, Ferrer 2013: error models of a MEMS IMU through GPS outages.

What is printed stands in `paper.yaml`. Figures 1 to 3, 7 to 9 and 19 are block diagrams and
photographs; the working components are the mechanization, the closed loop and the wavelet filter
bank of the library.
"""

from schuler_papers.judging import load_experiments

EXPERIMENTS = load_experiments(__name__)
"""All that is done again of this paper."""
