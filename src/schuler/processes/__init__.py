"""The algebra of sensor errors: sums of independent stochastic processes."""

from schuler.processes.arma import ARMA
from schuler.processes.autoregressive import Autoregressive
from schuler.processes.base import Process, StateSpace
from schuler.processes.drifts import RandomWalk, RateRamp, Sinusoid, TurnOnBias
from schuler.processes.gauss_markov import BiasInstability, GaussMarkov
from schuler.processes.noise_model import NoiseModel
from schuler.processes.sums import ProcessSum
from schuler.processes.white import Quantization, WhiteNoise

__all__ = [
    "ARMA",
    "Autoregressive",
    "BiasInstability",
    "GaussMarkov",
    "NoiseModel",
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
