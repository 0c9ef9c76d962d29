"""The algebra of sensor errors: sums of independent stochastic processes."""

from schuler.noise.arma import ARMA
from schuler.noise.autoregressive import Autoregressive
from schuler.noise.base import Parameter, Process, ProcessSum, StateSpace
from schuler.noise.drifts import RandomWalk, RateRamp, Sinusoid, TurnOnBias
from schuler.noise.gauss_markov import BiasInstability, GaussMarkov
from schuler.noise.noise_model import NoiseModel
from schuler.noise.white import Quantization, WhiteNoise

__all__ = [
    "ARMA",
    "Autoregressive",
    "BiasInstability",
    "GaussMarkov",
    "NoiseModel",
    "Parameter",
    "Process",
    "ProcessSum",
    "Quantization",
    "RandomWalk",
    "RateRamp",
    "Sinusoid",
    "StateSpace",
    "TurnOnBias",
    "WhiteNoise",
]
