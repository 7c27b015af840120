"""Measures of a drive, in the terms of Francis et al. 2023 (guidelines for social navigation)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pedpred.driving.course import Walls
from pedpred.driving.loop import Drive
from pedpred.driving.risk import contact_m
from pedpred.driving.robot import Robot
from pedpred.scenes import BODY_M
from pedpred.simulation.physics import value_at

_MOVING_MPS = 0.05
_NEW_S = 1.0
_PERSONAL_M = 0.45  # between the edges of robot and person: the intimate distance of Hall 1966


@dataclass(frozen=True)
class Contacts:
    """Moments at which the discs of the robot and of a person begin to overlap.

    Attributes:
        time_s: since the first command, between two instants. [Q]
        person: column of `Drive.people`. [Q]
        fault: whether it is the robot's fault: it moves towards the person, who has been there for 1 s at
            least. A robot that stands is never at fault. [Q] bool
        speed_mps: of the robot relative to the person. [Q]
    """

    time_s: np.ndarray
    person: np.ndarray
    fault: np.ndarray
    speed_mps: np.ndarray


def find_contacts(drive: Drive, radius_m: float) -> Contacts:
    """Find contacts, also those that begin and end between two instants.

    Robot and people move straight between instants: with r the vector between them at the first of two and u
    its change, contact begins at the smaller root f in (0, 1] of |r + f u| = R, if |r| > R. One that begins
    exactly at an instant belongs to the interval before it.

    Args:
        drive: what happened.
        radius_m: of the robot.
    """
    robot, reach = drive.state[:, :2], contact_m(radius_m)
    between = drive.people - robot[:, None]
    r, u = between[:-1], np.diff(between, axis=0)
    square, product = (u**2).sum(axis=-1), (r * u).sum(axis=-1)
    outside = (between**2).sum(axis=-1) - reach**2
    before, after = outside[:-1], outside[1:]
    inside = product**2 - square * before
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (-product - np.sqrt(np.maximum(inside, 0.0))) / square
        begins = (before > 0) & (product < 0) & ((after <= 0) | ((inside >= 0) & (share <= 1)))
    tick, person = np.nonzero(begins)
    share = np.minimum(share[tick, person], 1.0)
    at = r[tick, person] + share[:, None] * u[tick, person]
    velocity = np.diff(robot, axis=0)[tick] / drive.dt_s
    towards = (velocity * at).sum(axis=-1) / reach
    known = drive.there_s[tick, person] >= _NEW_S
    relative = np.sqrt(square[tick, person]) / drive.dt_s
    return Contacts((tick + share) * drive.dt_s, person, (towards > _MOVING_MPS) & known, relative)


@dataclass(frozen=True)
class Measures:
    """Figures of one drive; the names are the columns of the table.

    Attributes:
        reached: whether it came to the goal in time.
        success: whether it did so without a collision at its fault.
        faults: collisions with people at its fault.
        contacts: all collisions with people.
        fault_speed_mps: largest relative speed of those at its fault; 0 without one.
        wall_contacts: times that it touched a wall.
        time_s: to the goal, or until time was over.
        time_ratio: time_s over that of the route at full speed.
        path_ratio: length of its path over that of the route; of a drive that reached the goal.
        intrusion_s: time with somebody's edge nearer than 0.45 m.
        nearest_m: least distance between edges, at any instant; less than 0 in a collision.
        stopped_s: time slower than 0.05 m/s.
        jerk_mps3: mean magnitude of the change of acceleration.
    """

    reached: int
    success: int
    faults: int
    contacts: int
    fault_speed_mps: float
    wall_contacts: int
    time_s: float
    time_ratio: float
    path_ratio: float
    intrusion_s: float
    nearest_m: float
    stopped_s: float
    jerk_mps3: float


def measure(drive: Drive, route_m: float, robot: Robot, walls: Walls) -> Measures:
    """Measure a drive.

    Args:
        drive: what happened.
        route_m: length of the shortest way.
        robot: that drove.
        walls: of the place.
    """
    contacts = find_contacts(drive, robot.radius_m)
    path, dt_s = drive.state[:, :2], drive.dt_s
    velocity = np.diff(path, axis=0) / dt_s
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    jerk = np.diff(velocity, n=2, axis=0) / dt_s**2
    gap = np.hypot(*np.moveaxis(drive.people - path[:, None], -1, 0)) - robot.radius_m - BODY_M
    nearest = np.nanmin(np.where(np.isfinite(gap), gap, np.inf), axis=1, initial=np.inf)
    clearance = [value_at(walls.distance, walls.origin, walls.cell_m, x, y) for x, y in path]
    touching = np.array(clearance) < robot.radius_m
    time_s, faults = (len(path) - 1) * dt_s, int(contacts.fault.sum())
    return Measures(
        reached=int(drive.reached),
        success=int(drive.reached and not faults),
        faults=faults,
        contacts=len(contacts.fault),
        fault_speed_mps=float(contacts.speed_mps[contacts.fault].max(initial=0.0)),
        wall_contacts=int((touching[1:] & ~touching[:-1]).sum()),
        time_s=time_s,
        time_ratio=time_s * robot.speed_mps / route_m,
        path_ratio=float(speed.sum() * dt_s / route_m) if drive.reached else float("nan"),
        intrusion_s=float((nearest < _PERSONAL_M).sum() * dt_s),
        nearest_m=float(nearest.min()),
        stopped_s=float((speed < _MOVING_MPS).sum() * dt_s),
        jerk_mps3=float(np.hypot(*jerk.T).mean()) if len(jerk) else 0.0,
    )
