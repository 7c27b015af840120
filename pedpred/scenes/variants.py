"""Data augmentation of whole scenes: mirror image and time reversal.

People walk plausibly in both, but the habits of the place are changed: where most people turn left they turn
right, and where they slow down they speed up. Training on all variants teaches walking in general.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pedpred.scenes.scene import Scene

_MIRROR = np.array([-1.0, 1.0])


def mirrored(scene: Scene) -> Scene:
    """Mirror a scene: x becomes -x, for people and obstacles."""
    places, people = scene.occupancy, scene.trajectories
    origin = np.array([-(places.origin[0] + places.extent_m[0]), places.origin[1]])
    vectors = {name: getattr(people, name) for name in ("position", "velocity", "goal")}
    flipped = {name: values * _MIRROR for name, values in vectors.items() if values is not None}
    return replace(
        scene,
        occupancy=replace(places, occupied=places.occupied[::-1].copy(), origin=origin),
        trajectories=replace(people, **flipped),
        camera=None,
    )


def backwards(scene: Scene) -> Scene:
    """Reverse time; goals are dropped."""
    people = scene.trajectories
    if not len(people):
        return replace(scene, camera=None)
    time_s = people.time_s.min() + people.time_s.max() - people.time_s
    velocity = None if people.velocity is None else -people.velocity
    return replace(
        scene, trajectories=replace(people, time_s=time_s, velocity=velocity, goal=None), camera=None
    )


VARIANTS = {
    "mirrored": mirrored,
    "backwards": backwards,
    "mirrored_backwards": lambda scene: mirrored(backwards(scene)),
}
"""Name -> function from scene to scene."""
