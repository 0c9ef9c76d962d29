"""Work that takes long: who does it, what is kept of it, what to show while it runs."""

from schuler.execution.executors import Workers, workers
from schuler.execution.progress import Progress, progress
from schuler.execution.tasks import Task, run_tasks

__all__ = ["Progress", "Task", "Workers", "progress", "run_tasks", "workers"]
