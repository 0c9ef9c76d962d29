"""Noise models in the forms of other programs: one module a form, each with its `Format`."""
