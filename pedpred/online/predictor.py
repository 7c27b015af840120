"""Frames of detections in, forecasts out."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pedpred.errors import ValueRuleError, brief
from pedpred.features import ForecastProtocol
from pedpred.files import as_path, check_input, check_output
from pedpred.forecasting.detections import is_in_sorted
from pedpred.forecasting.postprocessing import PlaceKnowledge, Postprocessing
from pedpred.geometry import rotate
from pedpred.online.caution import have_just_appeared, moving_shares, shorten_paths
from pedpred.online.correction import Correction
from pedpred.online.doubts import Doubts
from pedpred.online.frame import Frame
from pedpred.online.network import ExportedNetwork, read_description
from pedpred.online.past import earliest, kept_before, slots_for
from pedpred.online.people import People
from pedpred.online.places import read_place, write_place
from pedpred.online.registration import contradicted, keep_to_limit, register_detections
from pedpred.online.settings import OnlineSettings
from pedpred.online.shipped import default_model
from pedpred.online.steps import NetworkSteps, Stepped
from pedpred.online.stream import Arrival, StreamClock
from pedpred.scenes import Forecast, OccupancyMap
from pedpred.tracking import KalmanBank
from pedpred.tracking.tracks import TIME_TOLERANCE_S

_LOG = logging.getLogger(__name__)
NO_MAP = OccupancyMap(np.zeros((1, 1), bool), np.zeros(2), 1.0)
"""Free ground: what is assumed where no map is given."""


class OnlinePredictor:
    """Tracks the people around a robot and forecasts them, with a recurrent state per track.

    The network has its own time step: every `dt_s` after a person's first detection, its state advances.
    A frame in between gets a forecast from its own inputs and the state of the last step, which stays as it
    is, so any frame rate will do. If frames are rarer than steps, the missed steps are computed for their own
    instants, from what was known then. A network without memory has no steps; people choose among its modes
    together (`pedpred.forecasting.selection`), and trust in it, its errors at the place and its regions are
    learned from what people did (`pedpred.forecasting.trust`, `.local_errors`, `.regions`). One object serves
    one stream; it is not thread-safe. A copy (`copy.deepcopy`, `pickle`) goes on by itself.

    Attributes:
        description: what the model folder says about its network, with the tracker that is used.
        network: of the model folder.
        filters: that follow each person.
        postprocessing: what follows a network without memory.
        settings: how detections are treated.
        name: what a track is called in warnings; its number, unless it is given names.
    """

    def __init__(self, folder: Path | str, settings: OnlineSettings | None = None):
        checked: object = OnlineSettings() if settings is None else settings
        if not isinstance(checked, OnlineSettings):
            raise ValueRuleError("settings", checked, "it must be OnlineSettings or None")
        folder = as_path("folder", folder)
        check_input(folder, folder=True)
        described = read_description(folder)
        lost_after_s = described.protocol.lost_after_s
        if checked.max_age_s > lost_after_s + TIME_TOLERANCE_S:
            rule = f"it must be at most lost_after_s of the model, {lost_after_s:g} s"
            raise ValueRuleError("max_age_s", checked.max_age_s, rule)
        learns = checked.learn_noise
        if learns is None:
            learns = described.learn_noise and checked.tracker is None
        self.settings, self.network = checked, ExportedNetwork(folder, described)
        self.description = replace(described, tracker=checked.tracker or described.tracker)
        self.filters = KalmanBank.around(self.description.tracker, learns)
        self.postprocessing = Postprocessing(
            noise_m=checked.detection_noise_m,
            trust=checked.learn_trust,
            local_errors=checked.learn_local_errors,
        )
        self._steps = NetworkSteps(self.network, self.description, checked.max_age_s)
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
    def doubts(self) -> tuple[str, ...]:
        """What is wrong with many of the last detections, in words; see `pedpred.online.doubts`."""
        return self._doubts.texts

    @property
    def protocol(self) -> ForecastProtocol:
        """Time step, horizon and ages of the forecasts."""
        return self.description.protocol

    def reset(self) -> None:
        """Delete all tracks and what was learned at the place; the map stays."""
        self._begin(self._initial_place(), {})

    def save_place(self, path: Path | str) -> None:
        """Write what was learned at the place to a JSON file, for `load_place`.

        What was loaded and is not used, as trust where `learn_trust` is off, stays as it was.

        Raises:
            ValueRuleError: that is no path.
            OutputError: it cannot be written there; the message says why.
        """
        output = as_path("path", path)
        check_output(output)
        write_place(output, self._place, self._unused, self.network.checksum)

    def load_place(self, path: Path | str) -> None:
        """Delete all tracks, and go on with what the same network had learned; the map stays.

        Raises:
            ValueRuleError: that is no path.
            InputError: the file is missing, damaged or about another network; all is as it was.
        """
        checksum = self.network.checksum
        self._begin(*read_place(as_path("path", path), self._initial_place(), checksum))

    def _initial_place(self) -> PlaceKnowledge:
        return self.postprocessing.initial(self.protocol.horizon_steps)

    def _begin(self, place: PlaceKnowledge, unused: dict[str, Any]) -> None:
        """Start with nobody, and with what was learned; see `read_place`."""
        self._place, self._unused, self._doubts = place, unused, Doubts.none()
        self._clock = StreamClock(self.protocol.lost_after_s + TIME_TOLERANCE_S)
        self._people, self._lives = self._nobody(), 0
        _, self._last = self._forecast(self._steps.nobody(self._people), place, 0.0)

    def _nobody(self) -> People:
        past_s = self.description.features.past_s(self.protocol.dt_s)
        return People.nobody(self.description.memory, slots_for(past_s), len(self.filters.filters))

    @property
    def _ground(self) -> OccupancyMap:
        return NO_MAP if self._map is None else self._map

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
            ValueRuleError: one is not a number or out of range, or the shift has no two of them.
        """
        correction = Correction.checked(turn_rad, shift)
        self._people, self._place = correction.of_people(self._people), correction.of_place(self._place)

    def update(
        self, time_s: float, track_id: np.ndarray, position: np.ndarray, velocity: np.ndarray | None = None
    ) -> Forecast:
        """Add the detections of one instant; return a forecast of each person, whose arrays are read-only.

        A frame may be late: at the time of the last one or less than `max_age_s` before it, as from a second
        camera. Only people who have not been detected since are taken from it, and the forecasts are again
        for the time of the last frame. If it has no such people, or is older, it is dropped with a warning,
        and the last forecast is returned.

        A person who is not detected is extrapolated for `max_age_s`, and forgotten after the model's
        `lost_after_s`. If time jumps by more than that, forward or backward, or frames are earlier for 0.3 s
        while none is later, all tracks are deleted: twice after a false stamp.
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
            ValueRuleError: something is not a number, out of range, or an id appears twice.
                After any error everything is as it was before the call.
        """
        frame = Frame.checked(time_s, track_id, position, velocity)
        clock, arrival = self._clock.accept(frame.time_s, len(self._people))
        if arrival is Arrival.LATE:
            return self._complete(frame)
        people, place = self._people, self._place
        if arrival is not Arrival.NEXT:
            people, place = self._nobody(), place.without_people()
        until_s = frame.time_s - self.settings.snap_s
        people = self._steps.catch_up(people, until_s, self._ground, self._tell_lost)
        lost = frame.time_s - people.seen_s > clock.longest_s
        people = people.select(~lost) if lost.any() else people
        doubts, before = self._doubts.after(people, frame, self._map), self._doubts
        self._people, self._place, self._last = self._observe(people, place, frame, frame.time_s)
        self._clock, self._doubts, self._lives = clock, doubts, self._lives + len(frame)
        doubts.tell(before, frame.time_s)
        return self._last

    def _complete(self, frame: Frame) -> Forecast:
        """The last forecast, with people of a late frame who were not detected since; nothing is learned."""
        since = self._people.seen_s > frame.time_s - TIME_TOLERANCE_S
        new = ~np.isin(frame.track_id, self._people.track_id[since], assume_unique=True)
        now_s = self._clock.now_s
        if not new.any() or now_s - frame.time_s > self.settings.max_age_s - TIME_TOLERANCE_S:
            self._clock = self._clock.dropped(frame.time_s)
            return self._last
        self._people, _, self._last = self._observe(self._people, self._place, frame.select(new), now_s)
        self._clock, self._lives = self._clock.completed(), self._lives + len(frame)
        return self._last

    def _observe(
        self, people: People, place: PlaceKnowledge, frame: Frame, time_s: float
    ) -> tuple[People, PlaceKnowledge, Forecast]:
        """People after the detections of a frame, what is learned, and forecasts at a time, not before it."""
        people, frame = self._within_limit(people, frame)
        before = people.track_id[contradicted(people)]
        people = register_detections(
            people, frame, self.filters, self.description.standstill_mps, self._lives
        )
        false = people.track_id[contradicted(people)]
        if len(false := false[~is_in_sorted(before, false)]):
            text = (
                "velocities of tracks %s do not lead from position to position until %s s: "
                "give true ones of the world frame, or none; forecasts follow them"
            )
            _LOG.warning(text, self._named(false), frame.time_s)
        stepped = self._steps.forecast(people, time_s, self._ground, self._tell_lost)
        return stepped.people, *self._forecast(stepped, place, time_s)

    def _within_limit(self, people: People, frame: Frame) -> tuple[People, Frame]:
        """See `keep_to_limit`; those who are left out are named."""
        most = self.settings.most_people
        kept, taken = keep_to_limit(people, frame, most)
        if len(taken) < len(frame):
            named = self._named(np.setdiff1d(frame.track_id, taken.track_id, assume_unique=True))
            text = "%d of %d people at %s s left out, since most_people is %d: tracks %s"
            _LOG.warning(text, len(frame) - len(taken), len(frame), frame.time_s, most, named)
        return kept, taken

    def _tell_lost(self, track_id: np.ndarray, time_s: float) -> None:
        _LOG.warning("no forecast at %s s for tracks %s: they are forgotten", time_s, self._named(track_id))

    def _named(self, track_id: np.ndarray) -> str:
        return brief([self.name(track) for track in track_id.tolist()])

    def _forecast(
        self, stepped: Stepped, place: PlaceKnowledge, time_s: float
    ) -> tuple[PlaceKnowledge, Forecast]:
        """What is learned from the network's forecasts, and what is given."""
        people, rows = stepped.people, stepped.rows
        observers = people.at(rows, time_s)
        position, heading = observers.position, observers.heading_rad
        world = rotate(stepped.velocities.astype(np.float64), heading[:, None])
        there = stepped.predictions.in_world(position, heading)
        if not self.description.memory:
            seen = (people.seen_s[rows] == time_s) & people.past["kept"][rows]
            known = position, time_s, people.life[rows], people.detection[rows], seen
            alone = there.point
            place, there = self.postprocessing.apply(place, there, *known)
            world = world + np.diff(there.point - alone, axis=1, prepend=0.0) / there.dt_s
            share = self._moving_shares(people, rows)
            if not (share == 1.0).all():
                world, there = share[:, None, None] * world, shorten_paths(there, position, share)
        return place, Forecast(time_s, observers.track_id, world, there).locked()

    def _moving_shares(self, people: People, rows: np.ndarray) -> np.ndarray:
        """See `pedpred.online.caution`. [R]."""
        new = have_just_appeared((people.seen_s - people.born_s)[rows], kept_before(people.past, rows))
        if not new.any():
            return np.ones(len(rows))
        noise_m = max(self.description.tracker.position_noise_m, self.settings.detection_noise_m)
        last = people.detection[rows]
        first = earliest(people.past, rows, last)
        return moving_shares(first, last, new, people.covariance[rows], noise_m)
