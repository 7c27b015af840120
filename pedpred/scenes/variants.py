"""Data augmentation of whole scenes: mirror image and time reversal.

People walk plausibly in both, but the habits of the place are changed: where most people turn left they turn
right, and where they slow down they speed up. Training on all variants teaches walking in general.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pedpred.scenes.scene import Scene, Trajectories

_MIRROR = np.array([-1.0, 1.0])


def mirrored(scene: Scene) -> Scene:
    """Mirror a scene: x becomes -x, for people and obstacles."""
    places, people = scene.occupancy, scene.trajectories
    edge = -(places.origin[0] + places.extent_m[0])
    return replace(
        scene,
        occupancy=replace(
            places, occupied=places.occupied[::-1].copy(), origin=np.array([edge, places.origin[1]])
        ),
        trajectories=replace(
            people,
            position=people.position * _MIRROR,
            velocity=None if people.velocity is None else people.velocity * _MIRROR,
            goal=None if people.goal is None else people.goal * _MIRROR,
        ),
        camera=None,
    )


def backwards(scene: Scene) -> Scene:
    """Reverse time; goals are dropped."""
    people: Trajectories = scene.trajectories
    if not len(people.time_s):
        return replace(scene, camera=None)
    return replace(
        scene,
        trajectories=replace(
            people,
            time_s=people.time_s.min() + people.time_s.max() - people.time_s,
            velocity=None if people.velocity is None else -people.velocity,
            goal=None,
        ),
        camera=None,
    )


VARIANTS = {
    "mirrored": mirrored,
    "backwards": backwards,
    "mirrored_backwards": lambda scene: mirrored(backwards(scene)),
}
"""Name -> function from scene to scene."""
