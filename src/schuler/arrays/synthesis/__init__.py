"""One sensor out of several: weights, volatility, and the noise of what is fused."""
