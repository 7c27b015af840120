"""The Kalman filter of the textbook, by matrices, and two walks, for values by hand."""

import numpy as np
from scipy.linalg import solve_discrete_are

from pedpred.scenes import Trajectories

TIME_S = np.array([2.0, 2.3, 2.7, 2.72, 3.6])
WAY = np.array([[1.0, 4.0], [1.3, 3.9], [1.8, 3.5], [1.9, 3.6], [2.2, 2.4]])
SHORT_S, SHORT = np.array([2.1, 2.5, 3.1]), np.array([[9.0, 9.0], [8.7, 9.4], [8.1, 9.9]])


def two_walks():
    """Track 5 of three detections and track 8 of five."""
    track = np.repeat([8, 5], [5, 3])
    return Trajectories(np.append(TIME_S, SHORT_S), track, np.concatenate([WAY, SHORT]))


def textbook(time_s, places, q, r, v0):
    """Means [2, 2] and covariances [2, 2] of position and velocity after each detection, by matrices.

    F P F' + Q with the white-noise acceleration Q = q [[dt^3/3, dt^2/2], [dt^2/2, dt]]; K = P H' / S
    (Bar-Shalom, Li & Kirubarajan 2001, 6.2.2). Starts at the first detection, at rest.
    A detection sooner than 0.05 s after the one before has the variance r^2 0.05 / dt.
    """
    mean, cov = np.array([places[0], [0.0, 0.0]]), np.diag([r**2, v0**2])
    found = [(mean, cov)]
    for k, dt in enumerate(np.diff(time_s), 1):
        mean, cov = extrapolated(mean, cov, dt, q)
        gain = cov[:, 0] / (cov[0, 0] + r**2 * max(1.0, 0.05 / dt))
        mean = mean + gain[:, None] * (places[k] - mean[0])
        cov = cov - np.outer(gain, cov[0])
        found.append((mean, cov))
    return found


def settled(dt_s, q, r):
    """Covariance of position and velocity after a detection, if there was one every dt. [2, 2].

    Before it P = F P F' + Q - F P H' H P F' / S; after it, a share 1 - P_pp / S is left.
    """
    step, sight = np.array([[1.0, dt_s], [0.0, 1.0]]), np.array([[1.0], [0.0]])
    noise = q * np.array([[dt_s**3 / 3, dt_s**2 / 2], [dt_s**2 / 2, dt_s]])
    p = solve_discrete_are(step.T, sight, noise, np.array([[r**2]]))
    return p - np.outer(p[0], p[0]) / (p[0, 0] + r**2)


def extrapolated(mean, cov, dt, q):
    step = np.array([[1.0, dt], [0.0, 1.0]])
    noise = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return step @ mean, step @ cov @ step.T + noise


def lagrange(time_s, values, now_s):
    """The polynomial through all points; four points have one cubic spline, three one parabola."""
    total = 0.0
    for k, own in enumerate(time_s):
        others = np.delete(time_s, k)
        total = total + np.prod((now_s[:, None] - others) / (own - others), axis=1)[:, None] * values[k]
    return total
