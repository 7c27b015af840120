"""The lifecycle node: topics, parameters and timers around a `Follower`. Needs rclpy."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from pedpred.errors import ConfigError, PedpredError
from pedpred.files import check_output
from pedpred.online import OnlinePredictor
from pedpred.online.warming import warm_up
from pedpred.ros.message_types import TRANSFORMS, UPDATE_TYPE, serialize
from pedpred.ros.people import PEOPLE_FIELDS
from pedpred.ros.planning import GRID_TYPE, NO_MAP
from pedpred.ros2.counts import Counts
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE, Latencies, diagnose, diagnostics_content, status_values
from pedpred.ros2.follower import Follower
from pedpred.ros2.log import RosHandler, guarded
from pedpred.ros2.outputs import PEOPLE, PREDICTIONS, Answer, output_types
from pedpred.ros2.rehearsal import rehearse
from pedpred.ros2.settings import LIVE, NodeSettings, fields_of, unchangeable

_PEOPLE_DEPTH, _TF_DEPTH, _UPDATES_DEPTH, _PREDICTIONS_DEPTH = 50, 100, 50, 10
_RETRY_S, _DIAGNOSTICS_S, _PLACE_S = 0.02, 1.0, 60.0
_NOT_KEPT, _NOT_EMPTIED = "what was learned is not kept", "topics are not emptied"
_log = logging.getLogger("pedpred.ros2")
_Done = TransitionCallbackReturn


class PedpredNode(LifecycleNode):
    """Subscribes to `people`, `map`, /tf and /tf_static, publishes forecasts, see `output_types`.

    Configuring reads the parameters, compiles what is not compiled yet, subscribes to the map and to
    transforms and makes all publishers; activating subscribes to people.
    """

    def __init__(self) -> None:
        super().__init__("pedpred")
        for name, default, text in fields_of(NodeSettings):
            about = ParameterDescriptor(description=text, dynamic_typing=True)  # NodeSettings checks kinds
            self.declare_parameter(name, list(default) if isinstance(default, tuple) else default, about)
        self.add_on_set_parameters_callback(self._changed)
        self._follower: Follower | None = None
        self._latencies, self._diagnosed = Latencies(), Counts()
        self._sinks: dict[str, Any] = {}
        self._own: list[Any] = []
        self._people: Any = None
        self._retry: Any = None
        self._handler = RosHandler(self.get_logger())
        logging.getLogger("pedpred").addHandler(self._handler)
        logging.getLogger("pedpred").setLevel(logging.INFO)
        self._warn_of_unknown()

    def _warn_of_unknown(self) -> None:
        """Warn of parameters of files and arguments that nothing reads, such as misspelt ones."""
        overrides = getattr(self, "_parameter_overrides", {})  # rclpy has no public name for them
        unknown = [name for name in overrides if not (self.has_parameter(name) or name.startswith("qos_"))]
        if unknown:
            _log.warning("there is no parameter %s: pedpred-ros2 --help lists them", ", ".join(unknown))

    def start(self) -> bool:
        """Configure and activate, unless the parameter `autostart` leaves that to a lifecycle manager.

        Returns:
            Whether that worked; the log says why not.
        """
        if self.get_parameter("autostart").value is False:
            return True
        return self.trigger_configure() == _Done.SUCCESS and self.trigger_activate() == _Done.SUCCESS

    def destroy_node(self) -> None:
        """Keep what was learned, stop handing log records to ROS, then destroy the node."""
        self._forget_people()
        logging.getLogger("pedpred").removeHandler(self._handler)
        super().destroy_node()

    def _settings(self, changed: dict[str, Any] | None = None) -> NodeSettings:
        values: dict[str, Any] = {
            name: self.get_parameter(name).value for name, _, _ in fields_of(NodeSettings)
        } | (changed or {})
        listed = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
        return NodeSettings(**(values | listed))

    def _changed(self, parameters: list[Any]) -> SetParametersResult:
        declared = {name for name, _, _ in fields_of(NodeSettings)}
        changed = {one.name: one.value for one in parameters if one.name in declared}
        fixed = [] if self._follower is None else unchangeable(changed, self._follower.settings)
        if fixed:
            reason = f"{', '.join(fixed)}: clean up first; now may change: {', '.join(sorted(LIVE))}"
            return SetParametersResult(successful=False, reason=reason)
        try:
            settings = self._settings(changed)
        except (PedpredError, TypeError) as problem:
            return SetParametersResult(successful=False, reason=str(problem))
        if self._follower is not None:
            self._follower.settings = settings
            self._add_publishers()
        return SetParametersResult(successful=True)

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Read parameters, warm up, make publishers, subscribe to the map and to transforms."""
        return self._tried("not configured", self._configure, self._clean_up)

    def _tried(
        self, lost: str, act: Callable[[], object], undo: Callable[[], None]
    ) -> TransitionCallbackReturn:
        """Make a transition, or log why that fails and undo it: rclpy would not log the error."""
        try:
            act()
        except Exception as problem:
            _log.error("%s: %s", lost, problem, exc_info=not isinstance(problem, PedpredError))
            undo()
            return _Done.FAILURE
        return _Done.SUCCESS

    def _configure(self) -> None:
        settings = self._settings()
        topic = self.resolve_topic_name("map")
        if settings.use_map and NO_MAP.search(topic):
            rule = "costs are not a map: remap `map` to the topic of the map server, or set use_map to false"
            raise ConfigError("map", topic, rule)
        people_class = _message_class(settings.people_type)
        _log.info("compiling what is not compiled yet: up to a minute")
        warm_up(settings.folder)
        predictor = OnlinePredictor.load(settings.folder, settings.online())
        rehearse(predictor, settings)
        if settings.place is not None:
            check_output(settings.place)
        self._steps = predictor.protocol.horizon_steps
        decode = partial(deserialize_message, message_type=people_class)
        self._follower = Follower(
            predictor,
            settings,
            self._has_subscribers,
            decode_people=None if settings.people_type in PEOPLE_FIELDS else decode,
        )
        self._follower.load_place()
        self._latencies, self._diagnosed = Latencies(), Counts()
        self._add_publishers()
        if settings.use_map:
            for qos in (
                _latched(1),
                _sensor(1),
            ):  # the first receives no volatile map, the second no earlier one
                self._subscribe(GRID_TYPE, "map", self._map_received, qos, _silent_events())
            try:
                updates = f"{topic}_updates"
                update = _listener(updates, self._follower.map_update_came)
                self._subscribe(UPDATE_TYPE, updates, update, _reliable(_UPDATES_DEPTH))
            except ConfigError as problem:
                _log.info("updates of the map are not received: %s", problem)
        try:
            self._subscribe(
                TRANSFORMS,
                "/tf",
                _listener("/tf", partial(self._transforms_came, fixed=False)),
                _reliable(_TF_DEPTH),
            )
            fixed = _listener("/tf_static", partial(self._transforms_came, fixed=True))
            self._subscribe(TRANSFORMS, "/tf_static", fixed, _latched(_TF_DEPTH))
        except ConfigError as problem:
            _log.warning("people must be in the frame of the map: %s", problem)
        people = self.resolve_topic_name("people")
        if people in {one.topic_name for one in (*self._own, *self._sinks.values())}:
            rule = "this node uses it for something else: remap `people` to the topic of the tracker"
            raise ConfigError("people", people, rule)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._retry = self.create_timer(
            _RETRY_S, guarded("people left out", self._publish_answers), clock=steady
        )
        self._retry.cancel()  # each wake-up takes about a millisecond, so only while people wait
        status = guarded("/diagnostics left out", self._diagnose)
        kept = guarded(_NOT_KEPT, self._follower.save_place)
        gone = guarded(_NOT_EMPTIED, self._clear_outputs)
        self._own += [
            self._retry,
            *(self.create_timer(_DIAGNOSTICS_S, each, clock=steady) for each in (gone, status)),
        ]
        self._own.append(self.create_timer(_PLACE_S, kept, clock=steady))

    def _add_publishers(self) -> None:
        assert self._follower is not None
        for topic, kind in output_types(self._follower.settings, self._steps).items():
            if topic in self._sinks:
                continue
            try:
                made = _message_class(kind)
            except ConfigError as problem:
                _log.info("%s is not published: %s", topic, problem)
                continue
            depth = _PREDICTIONS_DEPTH if topic in (PREDICTIONS, PEOPLE) else 1
            self._sinks[topic] = self.create_lifecycle_publisher(made, topic, _latched(depth))
            if self._people is not None:
                self._sinks[topic].on_activate(None)
        if "/diagnostics" not in self._sinks:
            made = _message_class(DIAGNOSTICS_TYPE)
            self._sinks["/diagnostics"] = self.create_publisher(made, "/diagnostics", 10)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Subscribe to people."""
        done = self._tried("not activated", self._subscribe_to_people, self._forget_people)
        return super().on_activate(state) if done == _Done.SUCCESS else done

    def _subscribe_to_people(self) -> None:
        assert self._follower is not None
        settings = self._follower.settings
        reliable = settings.people_reliability == "reliable"
        qos = _reliable(_PEOPLE_DEPTH) if reliable else _sensor(_PEOPLE_DEPTH)
        self._people = self.create_subscription(
            _message_class(settings.people_type), "people", self._people_received, qos, raw=True
        )
        source = (
            f"{self.resolve_topic_name('people')} ({settings.people_type}, {settings.people_reliability})"
        )
        _log.info("forecasting people of %s on %s", source, self.resolve_topic_name(PREDICTIONS))

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Unsubscribe from people; the map and transforms are still received."""
        self._forget_people()
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Forget everything; parameters can be changed again."""
        self._clean_up()
        return _Done.SUCCESS

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """End."""
        self._clean_up()
        return _Done.SUCCESS

    def _forget_people(self) -> None:
        if self._retry is not None:
            self._retry.cancel()
        if self._people is not None:
            guarded(_NOT_EMPTIED, self._clear_outputs)(0.0)
            self.destroy_subscription(self._people)
            self._people = None
            if self._follower is not None:
                self._follower.inbox.clear()
                guarded(_NOT_KEPT, self._follower.save_place)()

    def _clean_up(self) -> None:
        self._forget_people()
        for one in self._own:
            (self.destroy_timer if hasattr(one, "timer_period_ns") else self.destroy_subscription)(one)
        for sink in self._sinks.values():
            lasting = isinstance(sink, LifecyclePublisher)
            (self.destroy_lifecycle_publisher if lasting else self.destroy_publisher)(sink)
        self._own, self._sinks, self._follower, self._retry = [], {}, None, None

    def _subscribe(
        self, kind: str, topic: str, callback: Callable[..., None], qos: QoSProfile, events: Any = None
    ) -> None:
        """Subscribe; without `events`, rclpy logs publishers whose QoS does not fit."""
        made = _message_class(kind)
        self._own.append(
            self.create_subscription(made, topic, callback, qos, event_callbacks=events, raw=True)
        )

    def _people_received(self, raw: bytes, info: dict[str, Any]) -> None:
        """Take people and what the middleware knows of their message: two arguments ask rclpy for it."""
        _listener("people", self._people_came)(raw, info["received_timestamp"])

    def _people_came(self, raw: bytes, received_ns: int) -> None:
        if self._follower is not None:
            waited_s = max(time.time_ns() - received_ns, 0) / 1e9 if received_ns else 0.0
            clock_ns = self.get_clock().now().nanoseconds
            self._follower.people_came(raw, clock_ns, time.monotonic(), waited_s)
            self._publish_answers()

    def _map_received(self, raw: bytes, info: dict[str, Any]) -> None:
        """Take a map and when it was sent; see `_people_received`."""
        if self._follower is not None:
            _listener("map", self._follower.map_came)(raw, info["source_timestamp"])

    def _transforms_came(self, raw: bytes, fixed: bool) -> None:
        if self._follower is not None:
            self._follower.transforms_came(raw, self.get_clock().now().nanoseconds / 1e9, fixed)
            if self._follower.inbox.is_waiting:
                self._publish_answers()

    def _publish_answers(self, _: object = None) -> None:
        if self._follower is None or self._people is None:
            return
        try:
            for answer in self._follower.answers(time.monotonic()):
                self._publish(answer)
                if answer.topic == PREDICTIONS:
                    self._latencies.add(time.monotonic() - self._follower.arrived_s)
        finally:
            (self._retry.reset if self._follower.inbox.is_waiting else self._retry.cancel)()

    def _clear_outputs(self, *after_s: float) -> None:
        if self._follower is not None and self._people is not None:
            for answer in self._follower.cleared(self.get_clock().now().nanoseconds, *after_s):
                self._publish(answer)

    def _publish(self, answer: Answer) -> None:
        if answer.topic in self._sinks:
            message = serialize(answer.kind, answer.content)  # rclpy takes bytes
            self._sinks[answer.topic].publish(message)

    def _has_subscribers(self, topic: str) -> bool:
        return topic in self._sinks and self._sinks[topic].get_subscription_count() > 0

    def _diagnose(self) -> None:
        if self._follower is None:
            return
        kinds = [
            one.topic_type for one in self.get_publishers_info_by_topic(self.resolve_topic_name("people"))
        ]
        latency_ms, now_s = self._latencies.median_ms(), time.monotonic()
        now_ns, name = self.get_clock().now().nanoseconds, self.get_fully_qualified_name().lstrip("/")
        rivals = self.count_publishers(self.resolve_topic_name(PREDICTIONS)) - 1
        known = len(kinds), self._diagnosed, kinds, latency_ms, now_ns, rivals
        level, summary = diagnose(self._follower, now_s, *known)
        self._diagnosed = replace(self._follower.counts)
        level, summary = (level, summary) if self._people is not None else (0, "not active")
        values = status_values(self._follower, self._latencies)
        content = diagnostics_content(name, level, summary, values, now_ns)
        self._sinks["/diagnostics"].publish(serialize(DIAGNOSTICS_TYPE, content))


def _listener(topic: str, callback: Callable[..., None]) -> Callable[..., None]:
    return guarded(f"message of {topic!r} left out", callback)


def _silent_events() -> Any:
    """Callbacks of a subscription that log nothing, not even a publisher whose QoS does not fit."""
    try:
        events = import_module("rclpy.event_handler")
    except ImportError:  # Humble
        events = import_module("rclpy.qos_event")
    return events.SubscriptionEventCallbacks(use_default_callbacks=False)


def _message_class(kind: str) -> Any:
    """The class of a message type.

    Raises:
        ConfigError: its package is not installed.
    """
    package, _, name = kind.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as cause:
        apt = f"ros-$ROS_DISTRO-{package.replace('_', '-')}"
        raise ConfigError(
            "type", kind, f"{package} is not installed or has no {name}: apt install {apt}"
        ) from cause


def _latched(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth)


def _sensor(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
