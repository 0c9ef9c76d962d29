"""`python -m schuler`."""

from __future__ import annotations

import sys

from schuler.cli import main

if __name__ == "__main__":
    sys.exit(main())
