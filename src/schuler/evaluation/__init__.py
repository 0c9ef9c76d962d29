"""How good a solution is where it hurts, and whether its uncertainty can be believed."""

from schuler.evaluation.outage_windows import OutageStatistics, OutageWindow
from schuler.evaluation.outages import OutageEvaluation, evaluate_outages

__all__ = ["OutageEvaluation", "OutageStatistics", "OutageWindow", "evaluate_outages"]
