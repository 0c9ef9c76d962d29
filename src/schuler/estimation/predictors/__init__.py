"""What predicts the next samples, and the floor under all of it."""
