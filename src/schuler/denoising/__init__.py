"""Wavelet de-noising: of whole records, and causal with its delay stated."""

from schuler.denoising.allan_effect import AllanEffect, allan_effect
from schuler.denoising.causal import CausalDenoiser
from schuler.denoising.thresholds import soft_risk, stein_threshold, universal_threshold
from schuler.denoising.wavelet import Denoised, denoise

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
