"""One step of the strapdown navigation equations in north-east-down on the turning ellipsoid.

Spec 7.1; Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., chapter 11;
Savage, Strapdown Inertial Navigation Integration Algorithm Design, J. Guidance 21, 1998. State
arrays are changed in place: position (latitude rad, longitude rad, height m), velocity (north,
east, down m/s), quaternion (scalar first, body to n), rotation (its matrix).
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.geodesy import gravity_down, radii_of_curvature
from schuler.kernels.types import FloatArray


@kernel(inline=True)
def half_angle_factors(squared: float) -> tuple[float, float]:
    """cos(a/2) and sin(a/2)/a from a²; series below 0.1 rad, exact to the last bit."""
    if squared < 1e-2:
        cosine = 1.0 - squared * (1 / 8 - squared * (1 / 384 - squared / 46080))
        factor = 0.5 - squared * (1 / 48 - squared * (1 / 3840 - squared / 645120))
        return cosine, factor
    angle = math.sqrt(squared)
    return math.cos(0.5 * angle), math.sin(0.5 * angle) / angle


@kernel(inline=True)
def rotate_after(quaternion: FloatArray, x: float, y: float, z: float) -> None:
    """Replace q by q(x, y, z) q: a further rotation vector given in the outer (n) frame."""
    c, s = half_angle_factors(x * x + y * y + z * z)
    x, y, z = s * x, s * y, s * z
    q0, q1, q2, q3 = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    quaternion[0] = c * q0 - x * q1 - y * q2 - z * q3
    quaternion[1] = c * q1 + x * q0 + y * q3 - z * q2
    quaternion[2] = c * q2 + y * q0 + z * q1 - x * q3
    quaternion[3] = c * q3 + z * q0 + x * q2 - y * q1


@kernel(inline=True)
def rotate_before(quaternion: FloatArray, x: float, y: float, z: float) -> None:
    """Replace q by q q(x, y, z): a further rotation vector given in the inner (body) frame."""
    c, s = half_angle_factors(x * x + y * y + z * z)
    x, y, z = s * x, s * y, s * z
    q0, q1, q2, q3 = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    quaternion[0] = q0 * c - q1 * x - q2 * y - q3 * z
    quaternion[1] = q0 * x + q1 * c + q2 * z - q3 * y
    quaternion[2] = q0 * y - q1 * z + q2 * c + q3 * x
    quaternion[3] = q0 * z + q1 * y - q2 * x + q3 * c


@kernel(inline=True)
def rotation_from_quaternion(quaternion: FloatArray, rotation: FloatArray) -> None:
    """Normalise the quaternion and write its matrix C_nb. Groves (2.34)."""
    a, b, c, d = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    scale = 1.0 / math.sqrt(a * a + b * b + c * c + d * d)
    a, b, c, d = a * scale, b * scale, c * scale, d * scale
    quaternion[0], quaternion[1], quaternion[2], quaternion[3] = a, b, c, d
    rotation[0, 0] = 1.0 - 2.0 * (c * c + d * d)
    rotation[0, 1] = 2.0 * (b * c - a * d)
    rotation[0, 2] = 2.0 * (b * d + a * c)
    rotation[1, 0] = 2.0 * (b * c + a * d)
    rotation[1, 1] = 1.0 - 2.0 * (b * b + d * d)
    rotation[1, 2] = 2.0 * (c * d - a * b)
    rotation[2, 0] = 2.0 * (b * d - a * c)
    rotation[2, 1] = 2.0 * (c * d + a * b)
    rotation[2, 2] = 1.0 - 2.0 * (b * b + c * c)


@kernel(inline=True)
def coning_and_sculling(
    angle: FloatArray,
    velocity: FloatArray,
    past: FloatArray,
    step: float,
    coning: FloatArray,
    sculling: FloatArray,
) -> None:
    """What a sample turns and pushes beyond its increments, as rate and force changed in it.

    Rate and specific force are taken as the cubic polynomials with the increments of this sample,
    `angle` and `velocity` (3,), and of the three before it: past (3, 6), their mean rates and
    forces, newest first. With x0 .. x3 the increments, newest first, the coning integral
    1/2 int alpha x w dt is the sum of k_ij x_i cross x_j below, and sculling, 1/2 int (alpha x f +
    upsilon x w) dt, the same form in both (Savage 1998). Of the terms of third
    order in sculling those that vanish for constant rate and force are here, to the first order
    of their change. Two increments alone would give x1 cross x0 / 12.
    """
    a0, a1, a2 = angle[0], angle[1], angle[2]
    u0, u1, u2 = velocity[0], velocity[1], velocity[2]
    # increments of the three samples before: angles b, c, d and velocities v, w, x
    b0, b1, b2 = past[0, 0] * step, past[0, 1] * step, past[0, 2] * step
    c0, c1, c2 = past[1, 0] * step, past[1, 1] * step, past[1, 2] * step
    d0, d1, d2 = past[2, 0] * step, past[2, 1] * step, past[2, 2] * step
    v0, v1, v2 = past[0, 3] * step, past[0, 4] * step, past[0, 5] * step
    w0, w1, w2 = past[1, 3] * step, past[1, 4] * step, past[1, 5] * step
    x0, x1, x2 = past[2, 3] * step, past[2, 4] * step, past[2, 5] * step
    # this sample with those before it: p and q of angles and of velocities
    k1, k2, k3 = -473.0 / 1890.0, 1919.0 / 15120.0, -53.0 / 1890.0
    p0 = k1 * b0 + k2 * c0 + k3 * d0
    p1 = k1 * b1 + k2 * c1 + k3 * d1
    p2 = k1 * b2 + k2 * c2 + k3 * d2
    q0 = k1 * v0 + k2 * w0 + k3 * x0
    q1 = k1 * v1 + k2 * w1 + k3 * x1
    q2 = k1 * v2 + k2 * w2 + k3 * x2
    # those before it among each other: b with r (s), c with d (x)
    k12, k13, k23 = -2.0 / 315.0, 29.0 / 15120.0, -1.0 / 3780.0
    r0, s0 = k12 * c0 + k13 * d0, k12 * w0 + k13 * x0
    r1, s1 = k12 * c1 + k13 * d1, k12 * w1 + k13 * x1
    r2, s2 = k12 * c2 + k13 * d2, k12 * w2 + k13 * x2
    coning[0] = a1 * p2 - a2 * p1 + b1 * r2 - b2 * r1
    coning[0] += k23 * (c1 * d2 - c2 * d1)
    coning[1] = a2 * p0 - a0 * p2 + b2 * r0 - b0 * r2
    coning[1] += k23 * (c2 * d0 - c0 * d2)
    coning[2] = a0 * p1 - a1 * p0 + b0 * r1 - b1 * r0
    coning[2] += k23 * (c0 * d1 - c1 * d0)
    sculling[0] = a1 * q2 - a2 * q1 + u1 * p2 - u2 * p1
    sculling[0] += b1 * s2 - b2 * s1 + v1 * r2 - v2 * r1
    sculling[0] += k23 * (c1 * x2 - c2 * x1 + w1 * d2 - w2 * d1)
    sculling[1] = a2 * q0 - a0 * q2 + u2 * p0 - u0 * p2
    sculling[1] += b2 * s0 - b0 * s2 + v2 * r0 - v0 * r2
    sculling[1] += k23 * (c2 * x0 - c0 * x2 + w2 * d0 - w0 * d2)
    sculling[2] = a0 * q1 - a1 * q0 + u0 * p1 - u1 * p0
    sculling[2] += b0 * s1 - b1 * s0 + v0 * r1 - v1 * r0
    sculling[2] += k23 * (c0 * x1 - c1 * x0 + w0 * d1 - w1 * d0)
    # (a x (a x f') - w' x (a x u)) / 24 with the changes f' and w' over a sample
    g0, g1, g2 = u0 - v0, u1 - v1, u2 - v2
    h0, h1, h2 = a0 - b0, a1 - b1, a2 - b2
    m0, m1, m2 = a1 * g2 - a2 * g1, a2 * g0 - a0 * g2, a0 * g1 - a1 * g0
    n0, n1, n2 = a1 * u2 - a2 * u1, a2 * u0 - a0 * u2, a0 * u1 - a1 * u0
    sculling[0] += (a1 * m2 - a2 * m1 - h1 * n2 + h2 * n1) / 24.0
    sculling[1] += (a2 * m0 - a0 * m2 - h2 * n0 + h0 * n2) / 24.0
    sculling[2] += (a0 * m1 - a1 * m0 - h0 * n1 + h1 * n0) / 24.0


@kernel(inline=True)
def remember_sample(angle: FloatArray, velocity: FloatArray, step: float, past: FloatArray) -> None:
    """Move the samples of `past` (3, 6) one back, and put this one first, as rates."""
    for i in range(3):
        past[2, i], past[2, 3 + i] = past[1, i], past[1, 3 + i]
        past[1, i], past[1, 3 + i] = past[0, i], past[0, 3 + i]
        past[0, i] = angle[i] / step
        past[0, 3 + i] = velocity[i] / step


@kernel(inline=True)
def strapdown_step(
    dt: float,
    increment_angle: FloatArray,
    increment_velocity: FloatArray,
    coning: FloatArray,
    sculling: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    quaternion: FloatArray,
    rotation: FloatArray,
    earth: FloatArray,
) -> None:
    """Advance the navigation state by one step.

    Parameters are increments over this step (3,) in rad and m/s with what `coning_and_sculling`
    adds to them, then the state, changed in place. `earth` (10,) receives what the error model
    needs: specific force in n (3), the n-frame's rate (3), the Coriolis rate (3), the vertical
    gravity gradient.
    """
    a0, a1, a2 = increment_angle[0], increment_angle[1], increment_angle[2]
    u0, u1, u2 = increment_velocity[0], increment_velocity[1], increment_velocity[2]
    phi0, phi1, phi2 = a0 + coning[0], a1 + coning[1], a2 + coning[2]
    # velocity increment in the body frame at the start, turning at a constant rate:
    # u + a x u (1/2 - a²/24) + a x (a x u)/6
    square = a0 * a0 + a1 * a1 + a2 * a2
    along = (a0 * u0 + a1 * u1 + a2 * u2) / 6.0
    turn = 0.5 - square / 24.0
    rest = 1.0 - square / 6.0
    s0 = rest * u0 + turn * (a1 * u2 - a2 * u1) + a0 * along + sculling[0]
    s1 = rest * u1 + turn * (a2 * u0 - a0 * u2) + a1 * along + sculling[1]
    s2 = rest * u2 + turn * (a0 * u1 - a1 * u0) + a2 * along + sculling[2]
    f0 = rotation[0, 0] * s0 + rotation[0, 1] * s1 + rotation[0, 2] * s2
    f1 = rotation[1, 0] * s0 + rotation[1, 1] * s1 + rotation[1, 2] * s2
    f2 = rotation[2, 0] * s0 + rotation[2, 1] * s1 + rotation[2, 2] * s2

    latitude, height = position[0], position[2]
    north, east, down = velocity[0], velocity[1], velocity[2]
    sine, cosine = math.sin(latitude), math.cos(latitude)
    meridian, transverse = radii_of_curvature(sine)
    meridian += height
    transverse += height
    gravity = gravity_down(sine, height)
    # rates at the middle of the step
    north_mid = north + 0.5 * f0
    east_mid = east + 0.5 * f1
    down_mid = down + 0.5 * (f2 + gravity * dt)
    earth_north = 7.292115e-5 * cosine
    earth_down = -7.292115e-5 * sine
    transport_north = east_mid / transverse
    transport_east = -north_mid / meridian
    transport_down = -east_mid * sine / (cosine * transverse)
    i0 = earth_north + transport_north
    i1 = transport_east
    i2 = earth_down + transport_down
    k0 = i0 + earth_north
    k1 = i1
    k2 = i2 + earth_down
    # the n frame turns by i dt during the step: half of it acts on the force
    half = 0.5 * dt
    g0 = f0 - half * (i1 * f2 - i2 * f1)
    g1 = f1 - half * (i2 * f0 - i0 * f2)
    g2 = f2 - half * (i0 * f1 - i1 * f0)
    new_north = north + g0 - dt * (k1 * down_mid - k2 * east_mid)
    new_east = east + g1 - dt * (k2 * north_mid - k0 * down_mid)
    new_down = down + g2 - dt * (k0 * east_mid - k1 * north_mid) + gravity * dt

    # trapezoid for position; radii at the start are good to 1e-12 of the step
    new_latitude = latitude + half * (north + new_north) / meridian
    position[2] = height - half * (down + new_down)
    middle = cosine - 0.5 * sine * (new_latitude - latitude)
    position[1] += half * (east + new_east) / (transverse * middle)
    position[0] = new_latitude
    velocity[0], velocity[1], velocity[2] = new_north, new_east, new_down

    rotate_before(quaternion, phi0, phi1, phi2)
    rotate_after(quaternion, -i0 * dt, -i1 * dt, -i2 * dt)
    rotation_from_quaternion(quaternion, rotation)

    inverse = 1.0 / dt
    earth[0], earth[1], earth[2] = f0 * inverse, f1 * inverse, f2 * inverse
    earth[3], earth[4], earth[5] = i0, i1, i2
    earth[6], earth[7], earth[8] = k0, k1, k2
    earth[9] = 2.0 * gravity / (6378137.0 + height)
