"""What a filter is told of its sensors: states of any noise model, and the named models."""
