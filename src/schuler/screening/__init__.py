"""Is a recording what it claims: units, rate, gaps, stuck axes, knocks, motion."""
