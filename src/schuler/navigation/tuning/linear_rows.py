"""Measurements of a run, and what becomes of them with another setup."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.aiding.schedule import (
    POSITION,
    VEHICLE_VELOCITY,
    VELOCITY,
    AidingSchedule,
)
from schuler.navigation.engine import FilterRun
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import epochs_at
from schuler.rotations import dcm_from_rotation_vector, skew
from schuler.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class AntennaPath:
    """How an antenna moves, without the jumps of the filter; between samples as the filter does."""

    time: FloatArray  # (n,): of the samples, s
    # velocity, way: (n, 3) NED, m/s, and its integral, m
    velocity: FloatArray
    way: FloatArray

    @classmethod
    def of(
        cls, imu: ImuRecording, setup: RunSetup, run: FilterRun, jumps: FloatArray
    ) -> AntennaPath:
        """Undo the `jumps` (n, 3) of velocity up to every sample."""
        velocity = run.samples.velocity + jumps
        turning = np.cross(imu.gyro, setup.lever_arm)
        velocity += np.einsum("nij,nj->ni", run.samples.rotation, turning)
        mean = 0.5 * (velocity[1:] + velocity[:-1])
        way = np.cumsum(mean * np.diff(imu.time)[:, None], axis=0)
        return cls(imu.time, velocity, np.concatenate([np.zeros((1, 3)), way]))

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocity and way at some times."""
        after = np.clip(np.searchsorted(self.time, time), 1, self.time.size - 1)
        since = (time - self.time[after - 1])[:, None]
        begin, step = self.velocity[after - 1], self.time[after] - self.time[after - 1]
        slope = (self.velocity[after] - begin) / step[:, None]
        return begin + slope * since, self.way[after - 1] + since * (begin + 0.5 * slope * since)


@dataclass(frozen=True, slots=True, eq=False)
class RowTable:
    """Measurements in the order of a run, with what it knew before each of them."""

    time: FloatArray  # (r,): s
    # kind, node, fix: (r,) kind of aiding, node of the run, epoch of GNSS (-1: none)
    kind: IntArray
    node: IntArray
    fix: IntArray
    design: FloatArray  # (r, 3, s): H
    variance: FloatArray  # (r, 3): of the noise; 0 where a component is not used.
    extra: FloatArray  # (r, 3): what of it is not the measurement's own
    claimed: FloatArray  # (r, 3): what a receiver claims by itself
    residual: FloatArray  # (r, 3): predicted minus measured
    correction: FloatArray  # (r, s): what was fed back after it
    # rotation, turn: (r, 3, 3) C_nb, and how a metre of lever arm shows in velocity
    rotation: FloatArray
    turn: FloatArray
    push: FloatArray  # (r, 3, 3 + m): derivatives of acceleration by attitude and sensor states
    jump: FloatArray  # (r, 3): what was fed back to velocity before it
    sensors: FloatArray  # (r, m): sensor states
    sample: IntArray  # (r,): into which it falls
    path: AntennaPath  # of the whole drive

    @classmethod
    def of(
        cls,
        imu: ImuRecording,
        fixes: GnssRecording,
        setup: RunSetup,
        schedule: AidingSchedule,
        run: FilterRun,
    ) -> RowTable:
        """Gather what a run knew."""
        aiding, nodes, time = run.aiding, run.nodes, schedule.time
        innovation, spread = np.moveaxis(aiding.scalar, 2, 0)
        used = spread > 0.0
        share = np.einsum("uis,uis->ui", aiding.row, aiding.gain)
        variance = np.where(used, spread * (1.0 - share), 0.0)
        own = np.where(used & (schedule.kind[:, None] != POSITION), schedule.variance, variance)
        fix = _fixes_of(schedule, fixes, setup)
        correction = np.einsum("uis,ui->us", aiding.gain, np.where(used, innovation, 0.0))
        node = np.repeat(np.arange(nodes.time.size), nodes.aid[:, 1] - nodes.aid[:, 0])
        before = np.cumsum(correction, axis=0) - correction
        at_node = nodes.sensor_state[node] - nodes.error[node, 9:]
        within = before - before[nodes.aid[node, 0]]
        sensors = at_node + within[:, 9:]
        sample = np.clip(np.searchsorted(imu.time, time), 1, imu.size - 1)
        pushed, turned = _shown(setup)
        rate = imu.gyro[sample] - sensors @ turned
        since = (time - imu.time[sample - 1])[:, None]
        rotation = run.samples.rotation[sample - 1] @ dcm_from_rotation_vector(rate * since)
        force = np.einsum("rij,rj->ri", rotation, imu.accel[sample])
        jumps = np.concatenate([before, nodes.error.sum(axis=0, keepdims=True)])[:, 3:6]
        jumps = jumps[np.searchsorted(time, imu.time, side="right")]
        return cls(
            time,
            schedule.kind,
            node,
            fix,
            aiding.row,
            variance,
            np.where(used, variance - own, 0.0),
            _claimed(schedule, fix, fixes),
            np.where(used, aiding.residual, 0.0),
            correction,
            rotation,
            rotation @ skew(rate),
            np.concatenate([skew(force), rotation @ pushed.T], axis=2),
            before[:, 3:6],
            sensors,
            sample,
            AntennaPath.of(imu, setup, run, jumps),
        )

    def taken(self, kept: BoolArray) -> BoolArray:
        """Return which measurements are taken where only some epochs of GNSS are kept."""
        return np.asarray((self.fix < 0) | kept[self.fix])

    def select(self, rows: IntArray, used: BoolArray) -> RowTable:
        """Some of the rows, in which those that are not used measure nothing."""
        some = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "path"}
        return replace(self, **some | {"variance": np.where(used[:, None], some["variance"], 0.0)})

    def seen(self, before: RunSetup, after: RunSetup) -> tuple[FloatArray, FloatArray]:
        """Design and residuals with other time offsets and another arm than those of the run."""
        design, residual = self.design.copy(), self.residual.copy()
        arm = after.lever_arm - before.lever_arm
        for kind, shift, turn in (
            (POSITION, after.offsets.position - before.offsets.position, self.rotation),
            (VELOCITY, after.offsets.velocity - before.offsets.velocity, self.turn),
        ):
            own = np.flatnonzero(self.kind == kind)
            if shift != 0.0:
                later, now = self.path.at(self.time[own] + shift), self.path.at(self.time[own])
                residual[own] += later[1 - kind] - now[1 - kind]
            if shift != 0.0 and kind == POSITION:
                residual[own] -= shift * self.jump[own]
                design[own[:, None], np.arange(3), np.arange(3, 6)] += shift
            elif shift != 0.0:
                design[own, :, 6:] += shift * self.push[own]
            if np.any(arm):
                there = turn[own] @ arm
                residual[own] += there
                design[own, :, 6:9] += skew(there)
                if kind == VELOCITY:
                    by_rate = skew(_shown(after)[1]) @ arm
                    design[own, :, 9:] += np.einsum("rij,mj->rim", self.rotation[own], by_rate)
        return design, residual

    def weighted(
        self,
        setup: RunSetup,
        design: FloatArray,
        residual: FloatArray,
        scale: FloatArray | None,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Design, residuals and variances with the noise of a setup, and what lasts of GNSS errors.

        `scale` (n, 6): what multiplies the white noise of samples.
        """
        factors, slow = setup.factors, setup.measurements.correlated
        design, residual, variance = design.copy(), residual.copy(), self.variance.copy()
        own = np.flatnonzero(self.kind == POSITION)
        claimed = self.claimed[own] * factors.position_sd**2
        if isinstance(slow, GnssErrorModel):
            axes = np.arange(3)
            at, states = own[:, None], slow.states(self.claimed[own])
            seen = np.sqrt(slow.slow * claimed)
            residual[own] += (seen + design[at, axes, 9 + states]) * self.sensors[at, states]
            design[at, axes, 9 + states] = -seen
            variance[own] = slow.white * claimed
        elif slow is None:
            variance[own] = claimed
        own = np.flatnonzero(self.kind == VELOCITY)
        variance[own] = self.claimed[own] * factors.velocity_sd**2
        if np.any(setup.lever_arm):
            variance[own] += self.by_gyros(own, setup, scale)
        if setup.vehicle is not None:
            own = np.flatnonzero(self.kind == VEHICLE_VELOCITY)
            across = [setup.vehicle.lateral_sd, setup.vehicle.vertical_sd]
            variance[own, 1:] = np.square(across) + self.extra[own, 1:]
        used = self.variance > 0.0
        return design, np.where(used, residual, 0.0), np.where(used, variance, 0.0)

    def by_gyros(self, rows: IntArray, setup: RunSetup, scale: FloatArray | None) -> FloatArray:
        """Variance (.., 3) that the noise of one sample of the gyros puts into the velocity."""
        sample = self.sample[rows]
        density = np.broadcast_to(setup.model.white_density[3:] ** 2, (rows.size, 3))
        if scale is not None:
            density = density * scale[sample, 3:]
        shown = (self.rotation[rows] @ skew(setup.lever_arm)) ** 2
        step = self.path.time[sample] - self.path.time[sample - 1]
        return np.asarray(np.einsum("rij,rj->ri", shown, density) / step[:, None])


def _claimed(schedule: AidingSchedule, fix: IntArray, fixes: GnssRecording) -> FloatArray:
    """Squared standard deviations that the receiver claims; 0 where it does not measure."""
    claimed = np.zeros((schedule.size, 3))
    for kind, sd in ((POSITION, fixes.position_sd), (VELOCITY, fixes.velocity_sd)):
        rows = np.flatnonzero(schedule.kind == kind)
        if sd is not None:
            claimed[rows] = sd[fix[rows]] ** 2
    return claimed


def _shown(setup: RunSetup) -> tuple[FloatArray, FloatArray]:
    """How sensor states show in the accelerometers and in the gyros (m, 3)."""
    model = setup.model
    shown = np.where(np.isnan(model.direction), np.eye(3)[model.channel % 3], model.direction)
    gyro, none = (model.channel >= 3)[:, None], (model.channel < 0)[:, None]
    return np.where(gyro | none, 0.0, shown), np.where(gyro, shown, 0.0)


def _fixes_of(schedule: AidingSchedule, fixes: GnssRecording, setup: RunSetup) -> IntArray:
    """Epoch of GNSS of each measurement; -1: of none."""
    found = np.full(schedule.size, -1)
    for kind, offset in (
        (POSITION, setup.offsets.position),
        (VELOCITY, setup.offsets.velocity),
    ):
        rows = np.flatnonzero(schedule.kind == kind)
        found[rows] = epochs_at(fixes, schedule.time[rows] - offset)
    return found
