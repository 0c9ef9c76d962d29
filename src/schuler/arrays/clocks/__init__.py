"""Time in an array: clocks brought together, delays, one-sample jumps, chips that are polled."""
