"""Several IMUs made one: geometry, calibration between them, weights, noise and faults."""
