"""Sections that show the noise of sensors."""
