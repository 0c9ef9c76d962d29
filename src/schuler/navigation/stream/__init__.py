"""The filter in real time: one sample, one fix at a time, late fixes at their own time."""
