"""Sections that show navigation runs."""
