"""Wavelet de-noising: of whole records, and causal with its delay stated."""

from schuler.denoise.allan_effect import AllanEffect, allan_effect
from schuler.denoise.causal import CausalDenoiser
from schuler.denoise.thresholds import soft_risk, stein_threshold, universal_threshold
from schuler.denoise.wavelet import Denoised, denoise

__all__ = [
    "AllanEffect",
    "CausalDenoiser",
    "Denoised",
    "allan_effect",
    "denoise",
    "soft_risk",
    "stein_threshold",
    "universal_threshold",
]
