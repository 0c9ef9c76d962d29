"""Several methods, parameters or records side by side."""
