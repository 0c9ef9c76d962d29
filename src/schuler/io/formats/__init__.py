"""Formats of loggers, receivers and autopilots: one module a format, each with its `Format`."""
