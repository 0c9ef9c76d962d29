"""From signals to processes, with standard errors."""
