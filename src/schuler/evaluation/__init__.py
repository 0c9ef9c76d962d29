"""How good a solution is where it hurts, and whether its uncertainty can be believed."""

from schuler.evaluation.outages import (
    OutageEvaluation,
    OutageStatistics,
    OutageWindow,
    evaluate_outages,
)

__all__ = ["OutageEvaluation", "OutageStatistics", "OutageWindow", "evaluate_outages"]
