"""Waegli, Guerrier, Skaloud 2008: redundant MEMS-IMUs and GPS for sports.

The rides with their truth stand in `rides`, what is run on them in `runs`, noise and faults of the
sensors in `sensors`, what it comes to in `items`; what is printed, in `paper.yaml`.
"""

from schuler_papers.judging import load_experiments

EXPERIMENTS = load_experiments(__name__)
"""All that is done again of this paper."""
