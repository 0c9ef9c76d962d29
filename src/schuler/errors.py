"""The exceptions of the library: what was found, what was expected, and the cure.

Every error that a user can cause is a `SchulerError`; the command line prints it as one line and
ends with exit code 2.
"""

from __future__ import annotations


class SchulerError(Exception):
    """Root of all errors raised on purpose.

    Parameters
    ----------
    found : str
        What was found, in the user's terms.
    expected : str, optional
        What was expected instead.
    cure : str, optional
        What the user can do about it.
    where : str, optional
        File, line, column or time at which it was found.
    """

    def __init__(self, found: str, *, expected: str = "", cure: str = "", where: str = "") -> None:
        self.found = found
        self.expected = expected
        self.cure = cure
        self.where = where
        super().__init__(str(self))

    def __str__(self) -> str:
        text = f"{self.where}: {self.found}" if self.where else self.found
        if self.expected:
            text += f"; expected {self.expected}"
        if self.cure:
            text += f"; {self.cure}"
        return " ".join(text.split())

    def at(self, where: str) -> SchulerError:
        """Return the same error with a place in front (kept if it already has one).

        Parameters
        ----------
        where : str
            File, line or time.

        Returns
        -------
        SchulerError
            An error of the same class.
        """
        place = f"{where}: {self.where}" if self.where else where
        return type(self)(self.found, expected=self.expected, cure=self.cure, where=place)


class InputError(SchulerError):
    """A file or an array that cannot be what it claims to be.

    Notes
    -----
    Says what was found, what was expected and the cure, on one line.

    Examples
    --------
    >>> import schuler
    >>> try:
    ...     schuler.read_imu("nothing.csv")
    ... except schuler.InputError as error:
    ...     print("nothing.csv" in str(error))
    True
    """


class UnitError(SchulerError):
    """A unit that is not understood, or is of the wrong kind."""


class ModelError(SchulerError):
    """A stochastic process or noise model that cannot exist or does not fit its use.

    Examples
    --------
    >>> import schuler
    >>> try:
    ...     schuler.GaussMarkov(1.0, -5.0)
    ... except schuler.ModelError:
    ...     print("refused")
    refused
    """


class EstimationError(SchulerError):
    """Data from which the wanted parameter cannot be found."""


class NavigationError(SchulerError):
    """A navigation run that cannot start or cannot go on."""
