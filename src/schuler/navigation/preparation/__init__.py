"""Before the first run: alignment, time offsets, mounting, gaps and restarts."""
