"""Many logs of many sensors: one database of what was measured, and what it says of the fleet."""

from schuler.fleet.batch import BatchReport, BatchSettings, run_batch
from schuler.fleet.database import FleetDatabase, stored_noise_model
from schuler.fleet.logs import LogEntry, list_logs
from schuler.fleet.summary import FleetParameter, FleetSummary, Trend, summarise_fleet

__all__ = [
    "BatchReport",
    "BatchSettings",
    "FleetDatabase",
    "FleetParameter",
    "FleetSummary",
    "LogEntry",
    "Trend",
    "list_logs",
    "run_batch",
    "stored_noise_model",
    "summarise_fleet",
]
