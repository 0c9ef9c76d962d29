"""Calibration between the IMUs of an array: axes, scale, lever arms, biases, their errors."""
