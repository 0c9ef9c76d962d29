"""Many logs of many sensors: one database of what was measured, and what it says of the fleet."""

from schuler.fleet.batch import BatchReport, BatchSettings, run_batch
from schuler.fleet.database import FleetDatabase
from schuler.fleet.logs import LogEntry, list_logs
from schuler.fleet.registry import KnownSensor, known_sensor
from schuler.fleet.summary import FleetParameter, FleetSummary, Trend, summarise_fleet

__all__ = [
    "BatchReport",
    "BatchSettings",
    "FleetDatabase",
    "FleetParameter",
    "FleetSummary",
    "KnownSensor",
    "LogEntry",
    "Trend",
    "known_sensor",
    "list_logs",
    "run_batch",
    "summarise_fleet",
]
