"""Every Numba function, and nothing else: plain arrays in, plain arrays out."""
