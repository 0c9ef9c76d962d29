"""AR models of a sensor as S004 finds them: de-noise the static record, then Burg."""

from __future__ import annotations

from schuler.data import CHANNELS, ImuRecording
from schuler.navigation.error_models.sensor_denoising import SensorDenoising
from schuler.noise import Autoregressive


def autoregressive_fits(
    static: ImuRecording,
    orders: tuple[int, ...] = (1, 3),
    denoising: SensorDenoising | None = None,
) -> dict[int, dict[str, Autoregressive]]:
    """Fit AR models to every channel of a static recording after de-noising.

    Parameters
    ----------
    static : ImuRecording
        At rest.
    orders : tuple of int
        Of the models.
    denoising : SensorDenoising, optional
        Levels by channel; those of S004 Table 7 if not given.

    Returns
    -------
    dict of int to dict of str to Autoregressive
        By order, then by channel; SI.

    Raises
    ------
    InputError
        Too short for the levels.

    Notes
    -----
    S004 section 5.1 and Table 2.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(1e-2))
    >>> record = schuler.simulate_static(noise, 300.0, 100.0, np.random.default_rng(0))
    >>> sorted(schuler.autoregressive_fits(record)[3])[:2]
    ['accel_x', 'accel_y']
    """
    from schuler.estimation.autoregressive.fit import fit_ar

    quiet = (denoising or SensorDenoising.table_7()).apply(static)
    dt = static.duration / (static.size - 1)
    found: dict[int, dict[str, Autoregressive]] = {p: {} for p in orders}
    for channel in CHANNELS:
        for p in orders:
            fit = fit_ar(quiet.channel(channel), p, method="burg")
            found[p][channel] = Autoregressive(tuple(fit.coefficients), fit.innovation_variance, dt)
    return found
