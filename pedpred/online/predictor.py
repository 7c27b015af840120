"""Frames of detections in, forecasts out."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError, brief
from pedpred.features import ForecastProtocol, Neighbours, Surroundings
from pedpred.files import as_path, check_input, check_output
from pedpred.forecasting.postprocessing import PlaceKnowledge, Postprocessing
from pedpred.geometry import rotate
from pedpred.online.caution import have_just_appeared, moving_shares, shorten_paths
from pedpred.online.correction import Correction
from pedpred.online.doubts import Doubts
from pedpred.online.frame import Frame
from pedpred.online.limit import keep_to_limit
from pedpred.online.network import ExportedNetwork, ModelDescription, read_description
from pedpred.online.past import earliest, kept_before, past_of, slots_for
from pedpred.online.people import People, next_ticks_s, register_detections
from pedpred.online.places import read_place, write_place
from pedpred.online.settings import OnlineSettings
from pedpred.online.shipped import default_model
from pedpred.online.velocities import contradicted
from pedpred.scenes import Forecast, OccupancyMap, Predictions
from pedpred.tracking import KalmanBank
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LOG = logging.getLogger(__name__)
NO_MAP = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
"""Free ground: what is assumed where no map is given."""
_WHY_JUMPS = "A clock was set, a stamp is false, or a recording or simulation began again"
_SET_BACK_S, _CALM_S = 0.3, 5.0
"""Frames that are earlier than the last one for so long, while none is later, are of a clock that was set
back, or that one false stamp had been ahead of. Each time, it must be for twice as long, until none was
earlier for some time: a fast sensor that lags behind a slow one must not make everybody new for ever."""


class OnlinePredictor:
    """Tracks the people around a robot and forecasts them, with a recurrent state per track.

    The network has its own time step: every `dt_s` after a person's first detection, its state advances.
    A frame in between gets a forecast from its own inputs and the state of the last step, which stays as it
    is, so any frame rate will do. If frames are rarer than steps, the missed steps are computed for their own
    instants, from what was known then. A network without memory has no steps; people choose among its modes
    together (`pedpred.forecasting.selection`), and trust in it and its regions learn from what people did
    (`pedpred.forecasting.trust`, `pedpred.forecasting.regions`). One object serves one stream; it is not
    thread-safe. A copy (`copy.deepcopy`, `pickle`) goes on by itself.

    Attributes:
        name: what a track is called in warnings; its number, unless somebody knows better.
    """

    def __init__(self, folder: Path | str, settings: OnlineSettings | None = None):
        checked: object = OnlineSettings() if settings is None else settings
        if not isinstance(checked, OnlineSettings):
            raise ValueRuleError("settings", checked, "it must be OnlineSettings or None")
        folder = as_path("folder", folder)
        check_input(folder, folder=True)
        self._about = read_description(folder)
        self._network = ExportedNetwork(folder, self._about)
        self._settings = checked
        lost_after_s = self._about.protocol.lost_after_s
        if checked.max_age_s > lost_after_s + TIME_TOLERANCE_S:
            rule = f"it must be at most lost_after_s of the model, {lost_after_s:g} s"
            raise ValueRuleError("max_age_s", checked.max_age_s, rule)
        self._about = replace(self._about, tracker=self._settings.tracker or self._about.tracker)
        learns = self._settings.learn_noise
        if learns is None:
            learns = self._about.learn_noise and self._settings.tracker is None
        self._bank = KalmanBank.around(self._about.tracker, learns)
        self._postprocessing = Postprocessing(
            noise_m=self._settings.detection_noise_m, trust=self._settings.learn_trust
        )
        self._map: OccupancyMap | None = None
        self.name: Callable[[int], object] = int
        self.reset()

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make the last forecast of a copy read-only, as it was."""
        self.__dict__.update(state)
        self._last.locked()

    @classmethod
    def load(
        cls, folder: Path | str | None = None, settings: OnlineSettings | None = None
    ) -> OnlinePredictor:
        """Read a model folder; without one, the default model that is part of the package.

        Raises:
            InputError: a file is missing, altered or of another version.
            ValueRuleError: the folder is no path, the settings are something else, or their `max_age_s` is
                above the model's `lost_after_s`, so that it would have no effect.
        """
        return cls(default_model() if folder is None else folder, settings)

    @property
    def description(self) -> ModelDescription:
        """What the model folder says about its network, with the tracker that is used."""
        return self._about

    @property
    def filters(self) -> KalmanBank:
        """The filters that follow each person."""
        return self._bank

    @property
    def network(self) -> ExportedNetwork:
        """The network of the model folder."""
        return self._network

    @property
    def settings(self) -> OnlineSettings:
        """How detections are treated."""
        return self._settings

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is wrong with many of the last detections, in words; see `pedpred.online.doubts`."""
        return self._doubts.texts

    @property
    def protocol(self) -> ForecastProtocol:
        """Time step, horizon and ages of the forecasts."""
        return self._about.protocol

    def reset(self) -> None:
        """Delete all tracks and what was learned at the place; the map stays."""
        self._begin(self._unlearned(), {})

    def save_place(self, path: Path | str) -> None:
        """Write what was learned at the place to a JSON file, for `load_place`.

        What was loaded and is not used, as trust where `learn_trust` is off, stays as it was.

        Raises:
            ValueRuleError: that is no path.
            OutputError: it cannot be written there; the message says why.
        """
        output = as_path("path", path)
        check_output(output)
        write_place(output, self._place, self._unused, self._network.checksum)

    def load_place(self, path: Path | str) -> None:
        """Delete all tracks, and go on with what the same network had learned; the map stays.

        Raises:
            ValueRuleError: that is no path.
            InputError: the file is missing, damaged or about another network; all is as it was.
        """
        checksum = self._network.checksum
        self._begin(*read_place(as_path("path", path), self._unlearned(), checksum))

    def _unlearned(self) -> PlaceKnowledge:
        return self._postprocessing.initial(self.protocol.horizon_steps)

    def _begin(self, place: PlaceKnowledge, unused: dict[str, Any]) -> None:
        """Start with nobody, and with what was learned; see `read_place`."""
        self._unused, self._doubts = unused, Doubts.none()
        self._people, self._now, self._jumps, self._lives = self._nobody(), -np.inf, 0, 0
        self._dropped_s = (np.inf, np.inf)  # the first and the last frame that were dropped since
        self._set_back_s, self._latest_drop_s = _SET_BACK_S, -np.inf
        self._place = place
        none, answer = np.zeros(0, int), self._network.nobody()
        _, self._last = self._forecast(self._people, place, none, answer.predictions, answer.velocities, 0.0)

    def _nobody(self) -> People:
        past_s = self._about.features.past_s(self.protocol.dt_s)
        return People.nobody(self._about.memory, slots_for(past_s), len(self._bank.filters))

    def set_map(self, occupancy: OccupancyMap) -> None:
        """Replace the static obstacles; without a map, the ground is free.

        Raises:
            ValueRuleError: it is not a map; the one before stays.
        """
        checked: object = occupancy
        if not isinstance(checked, OccupancyMap):
            raise ValueRuleError("occupancy", checked, "it must be an OccupancyMap")
        self._map = None if occupancy is NO_MAP else occupancy

    def correct(self, turn_rad: float, shift: np.ndarray) -> None:
        """Move all people known so far, as where a robot finds that it is elsewhere on its map.

        Its earlier detections then lie elsewhere, too: without this, everybody seems to have run there. The
        map stays, and so does the last forecast.

        Args:
            turn_rad: what was at p in the world frame is at p, turned about the origin by this angle, rad,
            shift: plus this, m. [2]

        Raises:
            ValueRuleError, ShapeError: one is not a number or out of range, or the shift has no two of them.
        """
        correction = Correction.checked(turn_rad, shift)
        self._people, self._place = correction.of_people(self._people), correction.of_place(self._place)

    def update(
        self, time_s: float, track_id: np.ndarray, position: np.ndarray, velocity: np.ndarray | None = None
    ) -> Forecast:
        """Add the detections of one instant; return a forecast of each person, whose arrays are read-only.

        Of a frame that is less than `max_age_s` earlier than the last one, or as late, as of a second camera,
        those count who were not detected since; forecasts are at the time of the last one again. Where nobody
        counts, it is dropped, with a warning, and the last forecast returned. A person who is not detected is
        extrapolated for `max_age_s`, and forgotten after the model's `lost_after_s`. If time jumps by more
        than that, forward or backward, or frames are earlier for 0.3 s while none is later, all tracks are
        deleted: twice after a false stamp.
        An id that jumps farther than anybody can move is a new person. People for whom the network gives no
        valid forecast are left out, named in a warning and forgotten. Of more than `most_people`, those who
        came first are followed; the others are left out and named in a warning. So are doubts (`doubts`).

        Args:
            time_s: of the frame, s; any rate, also an irregular one.
            track_id: whole numbers of 64 bits, each at most once. [D]
            position: world frame, m; ranges are those of `Trajectories`. [D, 2]
            velocity: true velocities, for sources that know them, m/s; those above `FASTEST_MPS` are
                shortened, with a warning, and people whose velocities do not lead from position to position
                are named in one. Without any, positions are filtered, which is better than a tracker's
                estimates. [D, 2]

        Raises:
            ValueRuleError, ShapeError: something is not a number, out of range, or an id appears twice.
            After any error everything is as it was before the call.
        """
        frame = Frame.checked(time_s, track_id, position, velocity)
        now, longest_s = frame.time_s, self.protocol.lost_after_s + TIME_TOLERANCE_S
        is_earlier = abs(now - self._now) <= longest_s and now <= self._now + TIME_TOLERANCE_S
        if is_earlier and not self._is_set_back(now):
            return self._completed(frame)
        people, place, jumps = self._people, self._place, self._jumps
        if is_earlier or abs(now - self._now) > longest_s:
            if len(people) and (now < self._now or not jumps):  # of long gaps the first one
                text = "time jumps from %s s to %s s (seconds?): all are forgotten. %s"
                _LOG.warning(text, self._now, now, _WHY_JUMPS)
            jumps += len(people) > 0
            people, place = self._nobody(), place.without_people()
        people = self._made_up(people, now - self._settings.snap_s)
        lost = now - people.seen_s > longest_s
        people = people.select(~lost) if lost.any() else people
        doubts, before = self._doubts.after(people, frame, self._map), self._doubts
        self._people, self._place, self._last = self._detected(people, place, frame, now)
        self._doubts = doubts
        doubts.tell(before, now)
        self._now, self._jumps, self._lives = now, jumps, self._lives + len(frame)
        if is_earlier:
            self._set_back_s *= 2
        elif now - self._latest_drop_s > _CALM_S:
            self._set_back_s = _SET_BACK_S
        self._dropped_s = (np.inf, np.inf)
        return self._last

    def _is_set_back(self, now: float) -> bool:
        """Whether an earlier frame is the last of many, all dropped, which rise by themselves."""
        first_s, last_s = self._dropped_s
        return now > last_s and now - first_s > self._set_back_s - TIME_TOLERANCE_S

    def _completed(self, frame: Frame) -> Forecast:
        """The last forecast, with people of another frame who were not detected since; nothing is learned."""
        since = self._people.seen_s > frame.time_s - TIME_TOLERANCE_S
        new = ~np.isin(frame.track_id, self._people.track_id[since], assume_unique=True)
        if not new.any() or self._now - frame.time_s > self._settings.max_age_s - TIME_TOLERANCE_S:
            first_s, last_s = self._dropped_s
            self._dropped_s = (first_s if frame.time_s > last_s else frame.time_s, frame.time_s)
            self._latest_drop_s = self._now
            if self._dropped_s[0] == frame.time_s:  # of several, the first one
                text = "frame at %s s dropped: the last one was at %s s. %s"
                _LOG.warning(text, frame.time_s, self._now, "Do two sources send the same people, or late?")
            return self._last
        self._people, _, self._last = self._detected(self._people, self._place, frame.select(new), self._now)
        self._lives += len(frame)
        self._dropped_s = (np.inf, np.inf)
        return self._last

    def _detected(
        self, people: People, place: PlaceKnowledge, frame: Frame, time_s: float
    ) -> tuple[People, PlaceKnowledge, Forecast]:
        """People after the detections of a frame, what is learned, and forecasts at a time, not before it."""
        people, frame = self._within_limit(people, frame)
        before = people.track_id[contradicted(people.astray)]
        people = register_detections(people, frame, self._bank, self._about.standstill_mps, self._lives)
        false = np.setdiff1d(people.track_id[contradicted(people.astray)], before, assume_unique=True)
        if len(false):
            text = (
                "velocities of tracks %s do not lead from position to position until %s s: "
                "give true ones of the world frame, or none; forecasts follow them"
            )
            _LOG.warning(text, self._named(false), frame.time_s)
        people, rows, predictions, velocities = self._predicted(people, time_s)
        return people, *self._forecast(people, place, rows, predictions, velocities, time_s)

    def _within_limit(self, people: People, frame: Frame) -> tuple[People, Frame]:
        """See `keep_to_limit`; who is left out is named."""
        most = self._settings.most_people
        kept, taken = keep_to_limit(people, frame, most)
        if len(taken) < len(frame):
            named = self._named(np.setdiff1d(frame.track_id, taken.track_id, assume_unique=True))
            text = "%d of %d people at %s s left out, since most_people is %d: tracks %s"
            _LOG.warning(text, len(frame) - len(taken), len(frame), frame.time_s, most, named)
        return kept, taken

    def _named(self, track_id: np.ndarray) -> str:
        return brief([self.name(track) for track in track_id.tolist()])

    def _made_up(self, people: People, until_s: float) -> People:
        """People after the steps that were due before a frame, each at its own instant."""
        while self._about.memory and len(people):
            due = self._due(people)
            first = due.min()
            if not first < until_s - TIME_TOLERANCE_S:
                break
            person = np.flatnonzero(due <= first + TIME_TOLERANCE_S)
            people, *_ = self._step(people, person, first, np.ones(len(person), bool))
        return people

    def _due(self, people: People) -> np.ndarray:
        """Time of everybody's next step, s; infinite if there is none before the person is forgotten. [N]."""
        if not self._about.memory:
            return np.full(len(people), np.inf)
        due = next_ticks_s(people, self.protocol.dt_s)
        gone = due > people.seen_s + self.protocol.lost_after_s
        return np.where(gone, np.inf, due)

    def _predicted(self, people: People, time_s: float) -> tuple[People, np.ndarray, Predictions, np.ndarray]:
        """Forecast everybody present; those whose step is due now take it.

        Returns:
            People afterwards; rows of those present; their predictions and velocities, see `_step`.
        """
        due = self._due(people) <= time_s + TIME_TOLERANCE_S
        person = np.flatnonzero(due | self._present(people, time_s))
        people, person, predictions, velocities = self._step(people, person, time_s, due[person])
        present = self._present(people, time_s)[person]
        if not present.all():
            person, velocities = person[present], velocities[present]
            predictions = predictions.select(present)
        return people, person, predictions, velocities

    def _present(self, people: People, time_s: float) -> np.ndarray:
        """Who was detected at most `max_age_s` ago. [N] bool."""
        return people.seen_s >= time_s - self._settings.max_age_s - TIME_TOLERANCE_S

    def _step(
        self, people: People, person: np.ndarray, time_s: float, keep: np.ndarray
    ) -> tuple[People, np.ndarray, Predictions, np.ndarray]:
        """Run the network for some people.

        Returns:
            People after the step of those to `keep`, without those for whom the network gave no forecast;
            rows of those for whom it gave one; predictions and velocities of `Answer`.
        """
        if len(person):
            inputs = self._inputs(people, person, time_s)
            memory = {name: values[person] for name, values in people.memory.items()}
            answer = self._network.step(inputs, memory)
        else:
            answer = self._network.nobody()
        if not answer.sound.all():
            stays = np.ones(len(people), bool)
            stays[person[~answer.sound]] = False
            named = self._named(people.track_id[~stays])
            _LOG.warning("no forecast at %s s for tracks %s: they are forgotten", time_s, named)
            person, keep = (np.cumsum(stays) - 1)[person[answer.sound]], keep[answer.sound]
            people = people.select(stays)
        if keep.any():
            people = people.stepped(
                person[keep], {name: after[keep] for name, after in answer.memory.items()}
            )
        return people, person, answer.predictions, answer.velocities

    def _inputs(self, people: People, person: np.ndarray, time_s: float) -> dict[str, np.ndarray]:
        """The network's inputs for some people, name -> [R, ...] float32."""
        observers = people.at(person, time_s)
        lately = time_s - people.seen_s <= self._settings.max_age_s + TIME_TOLERANCE_S
        everybody = lately.all() and len(observers) == len(people)
        crowd = observers if everybody else people.at(np.flatnonzero(lately), time_s)
        around = Neighbours.together(crowd, len(observers))
        past = past_of(people.past, person, people.seen_s, people.detection, people.covariance)
        now_s, features = np.full(len(observers), time_s), self._about.features
        ground = NO_MAP if self._map is None else self._map
        seen = Surroundings(observers, past, now_s, around, ground)
        inputs = features.graph_inputs(features.compute(seen, self.protocol.dt_s))
        return {name: inputs[name] for name in self._about.inputs}

    def _forecast(
        self,
        people: People,
        place: PlaceKnowledge,
        rows: np.ndarray,
        predictions: Predictions,
        velocities: np.ndarray,
        time_s: float,
    ) -> tuple[PlaceKnowledge, Forecast]:
        """What is given for some people, and what is learned from it."""
        observers = people.at(rows, time_s)
        position, heading = observers.position, observers.heading_rad
        world = rotate(velocities.astype(np.float64), heading[:, None])
        there = predictions.in_world(position, heading)
        if not self._about.memory:
            seen = (people.seen_s[rows] == time_s) & people.past["kept"][rows]
            lives, detection = people.life[rows], people.detection[rows]
            alone = there.point
            place, there = self._postprocessing.apply(place, there, position, time_s, lives, detection, seen)
            world = world + np.diff(there.point - alone, axis=1, prepend=0.0) / there.dt_s
        share = self._moving_shares(people, rows)
        if not (share == 1.0).all():
            world, there = share[:, None, None] * world, shorten_paths(there, position, share)
        return place, Forecast(time_s, observers.track_id, world, there).locked()

    def _moving_shares(self, people: People, rows: np.ndarray) -> np.ndarray:
        """See `pedpred.online.caution`. [R]."""
        if self._about.memory:
            return np.ones(len(rows))
        new = have_just_appeared((people.seen_s - people.born_s)[rows], kept_before(people.past, rows))
        if not new.any():
            return np.ones(len(rows))
        noise_m = max(self._about.tracker.position_noise_m, self.settings.detection_noise_m)
        last = people.detection[rows]
        first = earliest(people.past, rows, last)
        return moving_shares(first, last, new, people.covariance[rows], noise_m)
