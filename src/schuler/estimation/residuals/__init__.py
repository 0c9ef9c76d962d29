"""What is left when a model is taken off: tests and diagnostics."""
