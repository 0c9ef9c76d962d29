"""Sections that show arrays of IMUs."""
