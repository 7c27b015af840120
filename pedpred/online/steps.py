"""The network along the people of a stream: whose step is due, its inputs, and what it forecasts."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pedpred.features import Neighbours, Surroundings
from pedpred.features.surroundings import Past
from pedpred.online.network import ExportedNetwork, ModelDescription
from pedpred.online.past import past_of
from pedpred.online.people import People, next_steps_s
from pedpred.scenes import OccupancyMap, Predictions
from pedpred.tracking.tracks import TIME_TOLERANCE_S

TellLost = Callable[[np.ndarray, float], None]
"""Told the ids of people for whom the network gave no forecast, and when, s."""


class Stepped(NamedTuple):
    """People after a step of the network, and its forecasts of some of them.

    Attributes:
        people: without those for whom it gave no forecast.
        rows: who is forecast. [R]
        predictions: agent frames. R rows
        velocities: of the point forecast, agent frames, m/s. [R, P, 2]
    """

    people: People
    rows: np.ndarray
    predictions: Predictions
    velocities: np.ndarray


class NetworkSteps:
    """Runs a network for the people of a stream; it has no state of its own.

    A network with a memory steps every `dt_s` after a person's first detection; in between, it forecasts from
    the memory of the last step. One without has no steps.
    """

    def __init__(self, network: ExportedNetwork, about: ModelDescription, max_age_s: float):
        """Run `network`; `about`: its description; people are present for `max_age_s` after a detection."""
        self._network, self._about, self._max_age_s = network, about, max_age_s + TIME_TOLERANCE_S

    def nobody(self, people: People) -> Stepped:
        """Forecasts of none of the people."""
        answer = self._network.nobody()
        return Stepped(people, np.zeros(0, int), answer.predictions, answer.velocities)

    def catch_up(self, people: People, until_s: float, ground: OccupancyMap, lost: TellLost) -> People:
        """People after the steps that were due before an instant, each at its own time."""
        while self._about.memory and len(people):
            due = self._due_s(people)
            first_s = due.min()
            if not first_s < until_s - TIME_TOLERANCE_S:
                break
            rows = np.flatnonzero(due <= first_s + TIME_TOLERANCE_S)
            people = self._step(people, rows, first_s, np.ones(len(rows), bool), ground, lost).people
        return people

    def forecast(self, people: People, time_s: float, ground: OccupancyMap, lost: TellLost) -> Stepped:
        """Forecast everybody present at a time; those whose step is due take it."""
        due = self._due_s(people) <= time_s + TIME_TOLERANCE_S
        rows = np.flatnonzero(due | self._present(people, time_s))
        stepped = self._step(people, rows, time_s, due[rows], ground, lost)
        present = self._present(stepped.people, time_s)[stepped.rows]
        if present.all():
            return stepped
        return Stepped(
            stepped.people,
            stepped.rows[present],
            stepped.predictions.select(present),
            stepped.velocities[present],
        )

    def inputs(
        self, people: People, rows: np.ndarray, time_s: float, ground: OccupancyMap
    ) -> dict[str, np.ndarray]:
        """The network's inputs for some people at a time, name -> [R, ...] float32."""

        def past(some: np.ndarray) -> Past:
            return past_of(people.past, some, people.seen_s, people.detection, people.covariance)

        observers = people.at(rows, time_s)
        lately = time_s - people.seen_s <= self._max_age_s
        everybody = lately.all() and len(observers) == len(people)
        crowd = observers if everybody else people.at(np.flatnonzero(lately), time_s)
        around = Neighbours.of_crowd(crowd, len(observers), lambda some: past(np.flatnonzero(lately)[some]))
        seen = Surroundings(observers, past(rows), np.full(len(observers), time_s), around, ground)
        features = self._about.features
        inputs = features.graph_inputs(features.compute(seen, self._about.protocol.dt_s))
        return {name: inputs[name] for name in self._about.inputs}

    def _step(
        self,
        people: People,
        rows: np.ndarray,
        time_s: float,
        keep: np.ndarray,
        ground: OccupancyMap,
        lost: TellLost,
    ) -> Stepped:
        """Run the network for some people [R]; those to `keep` [R] bool have its memory afterwards."""
        if not len(rows):
            return self.nobody(people)
        memory = {name: values[rows] for name, values in people.memory.items()}
        answer = self._network.step(self.inputs(people, rows, time_s, ground), memory)
        if not answer.sound.all():
            stays = np.ones(len(people), bool)
            stays[rows[~answer.sound]] = False
            lost(people.track_id[~stays], time_s)
            rows, keep = (np.cumsum(stays) - 1)[rows[answer.sound]], keep[answer.sound]
            people = people.select(stays)
        if keep.any():
            people = people.stepped(rows[keep], {name: after[keep] for name, after in answer.memory.items()})
        return Stepped(people, rows, answer.predictions, answer.velocities)

    def _due_s(self, people: People) -> np.ndarray:
        """Time of everybody's next step, s; infinite if there is none before the person is forgotten. [N]."""
        if not self._about.memory:
            return np.full(len(people), np.inf)
        protocol = self._about.protocol
        due_s = next_steps_s(people, protocol.dt_s)
        return np.where(due_s > people.seen_s + protocol.lost_after_s, np.inf, due_s)

    def _present(self, people: People, time_s: float) -> np.ndarray:
        """Who was detected at most `max_age_s` ago. [N] bool."""
        return people.seen_s >= time_s - self._max_age_s
