"""What verbs of other packages may use."""

import collections.abc

from .console import Screen as Screen
from .console import say as say
from .job import command_provenance as command_provenance
from .loading import say_when_compiling as say_when_compiling
from .outputs import STDOUT as STDOUT
from .outputs import Outputs as Outputs
from .outputs import json_text as json_text

def main(arguments: collections.abc.Sequence[str] | None = None) -> int: ...

__all__ = [
    "STDOUT",
    "Outputs",
    "Screen",
    "command_provenance",
    "json_text",
    "main",
    "say",
    "say_when_compiling",
]
