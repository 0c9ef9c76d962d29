"""Runs spread over processes or machines, resumable, with progress.

A package that adds a verb or a study may use what is named here (see `schuler.cli`).
"""

from schuler.execution.executors import Workers, lent, one_thread, workers
from schuler.execution.progress import Progress, progress
from schuler.execution.store import Kept
from schuler.execution.tasks import CPU_SECONDS, Task, run_tasks

__all__ = [
    "CPU_SECONDS",
    "Kept",
    "Progress",
    "Task",
    "Workers",
    "lent",
    "one_thread",
    "progress",
    "run_tasks",
    "workers",
]
