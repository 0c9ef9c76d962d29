"""Makers of sections: one for each kind of result.

To show a new result, write a function that turns it into sections and register it with
`sections_of`; nothing else in the report has to know.
"""

from schuler.report.sections.registry import sections_of

__all__ = ["sections_of"]
