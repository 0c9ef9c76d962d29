"""What a reader did and what it took for granted, gathered on the way."""

from __future__ import annotations

from collections.abc import Iterable


class Notes:
    """Lines of history, and those among them that nobody told the reader.

    Parameters
    ----------
    history, assumptions : iterable of str
        What was said before.
    """

    def __init__(self, history: Iterable[str] = (), assumptions: Iterable[str] = ()) -> None:
        self.history = list(history)
        self.assumptions = list(assumptions)

    def did(self, *lines: str) -> None:
        """Add what was done, each line once."""
        self.history += [x for x in lines if x and x not in self.history]

    def assumed(self, *lines: str) -> None:
        """Add what was taken for granted; it is part of the history too."""
        self.did(*lines)
        self.assumptions += [x for x in lines if x and x not in self.assumptions]
