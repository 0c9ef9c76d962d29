"""What aids an inertial navigation solution: one module a source."""
