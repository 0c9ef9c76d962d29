"""Records larger than memory: one pass over their pieces, sums that add up, the usual fits."""

from schuler.estimation.long_record.fit import (
    NOT_LOOKED_AT,
    characterize_pieces,
    characterize_sums,
)
from schuler.estimation.long_record.sums import RecordSums, collect_sums

__all__ = [
    "NOT_LOOKED_AT",
    "RecordSums",
    "characterize_pieces",
    "characterize_sums",
    "collect_sums",
]
