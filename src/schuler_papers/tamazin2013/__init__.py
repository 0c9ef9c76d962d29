"""Tamazin, Noureldin, Korenberg 2013: AR models by three methods against fast orthogonal search.

What is printed stands in `paper.yaml`.
"""

from schuler_papers.judging import load_experiments

EXPERIMENTS = load_experiments(__name__)
"""All that is done again of this paper."""
