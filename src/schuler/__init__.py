"""MEMS inertial sensors: error models, redundant IMUs, and GNSS/INS with honest uncertainty.

The public nouns and verbs stand in `__init__.pyi`, once, and are imported when they are first
used: `import schuler` costs next to nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
