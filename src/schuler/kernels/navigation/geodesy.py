"""The WGS-84 ellipsoid and its gravity, one point at a time.

Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed.,
section 2.4. Constants are written out because a compiled kernel freezes global ones.
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel


@kernel(inline=True)
def radii_of_curvature(sine: float) -> tuple[float, float]:
    """Meridian and transverse radius (m) at latitude with the given sine. Groves (2.105-2.106)."""
    root = 1.0 - 6.69437999014e-3 * sine * sine
    transverse = 6378137.0 / math.sqrt(root)
    return transverse * (1.0 - 6.69437999014e-3) / root, transverse


@kernel(inline=True)
def gravity_down(sine: float, height: float) -> float:
    """Gravity along the ellipsoidal normal (m/s²): Somigliana and height to second order.

    Groves (2.134) for the ellipsoid; (2.139) for the height.
    """
    s2 = sine * sine
    surface = (
        9.7803253359 * (1.0 + 0.0019318526565863525 * s2) / math.sqrt(1.0 - 6.69437999014e-3 * s2)
    )
    ratio = height / 6378137.0
    slope = 1.0 + 3.35281066475e-3 * (1.0 - 2.0 * s2) + 3.449786506841e-3
    return surface * (1.0 - 2.0 * slope * ratio + 3.0 * ratio * ratio)
