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
from pedpred.ros.grids import GRID_TYPE, NO_MAP
from pedpred.ros.message_types import TRANSFORMS, UPDATE_TYPE, serialize
from pedpred.ros.people import PEOPLE_FIELDS
from pedpred.ros2.counts import Counts
from pedpred.ros2.diagnostics import DIAGNOSTICS_TYPE, Latencies, diagnose, diagnostics_content, status_values
from pedpred.ros2.follower import Follower
from pedpred.ros2.log import RosHandler, guarded
from pedpred.ros2.outputs import PEOPLE, PREDICTIONS, Output, output_types
from pedpred.ros2.rehearsal import rehearse
from pedpred.ros2.settings import LIVE, PARAMETERS, NodeSettings, unchangeable

_PEOPLE_DEPTH, _TF_DEPTH, _UPDATES_DEPTH, _PREDICTIONS_DEPTH = 50, 100, 50, 10
_RETRY_S, _DIAGNOSTICS_S, _PLACE_S = 0.02, 1.0, 60.0
_DIAGNOSTICS = "/diagnostics"
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
        for name, (default, text) in PARAMETERS.items():
            about = ParameterDescriptor(description=text, dynamic_typing=True)  # NodeSettings checks kinds
            self.declare_parameter(name, list(default) if isinstance(default, tuple) else default, about)
        self.add_on_set_parameters_callback(self._set_parameters)
        self._follower: Follower | None = None
        self._latencies, self._diagnosed = Latencies(), Counts()
        self._sinks: dict[str, Any] = {}
        self._own: list[Any] = []
        self._people: Any = None
        self._retry: Any = None
        self._handler = RosHandler(self.get_logger())
        logging.getLogger("pedpred").addHandler(self._handler)
        logging.getLogger("pedpred").setLevel(logging.INFO)
        overrides = getattr(self, "_parameter_overrides", {})  # rclpy has no public name for them
        unknown = [name for name in overrides if not (self.has_parameter(name) or name.startswith("qos_"))]
        if unknown:
            _log.warning("there is no parameter %s: pedpred-ros2 --help lists them", ", ".join(unknown))

    # Parameters and transitions

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
        self._unsubscribe_people()
        logging.getLogger("pedpred").removeHandler(self._handler)
        super().destroy_node()

    def _settings(self, changed: dict[str, Any]) -> NodeSettings:
        values = {name: self.get_parameter(name).value for name in PARAMETERS} | changed
        lists = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
        return NodeSettings(**(values | lists))

    def _set_parameters(self, parameters: list[Any]) -> SetParametersResult:
        changed = {one.name: one.value for one in parameters if one.name in PARAMETERS}
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
            self._add_publishers(self._follower)
        return SetParametersResult(successful=True)

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Read parameters, warm up, make publishers, subscribe to the map and to transforms."""
        return self._try("not configured", self._configure, self._clean_up)

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Subscribe to people."""
        done = self._try("not activated", self._subscribe_people, self._unsubscribe_people)
        return super().on_activate(state) if done == _Done.SUCCESS else done

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Unsubscribe from people; the map and transforms are still received."""
        self._unsubscribe_people()
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Forget everything; parameters can be changed again."""
        self._clean_up()
        return _Done.SUCCESS

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """End."""
        self._clean_up()
        return _Done.SUCCESS

    def _try(self, lost: str, act: Callable[[], object], undo: Callable[[], None]) -> Any:
        """Make a transition, or log why that fails and undo it: rclpy would not log the error."""
        try:
            act()
        except Exception as problem:
            _log.error("%s: %s", lost, problem, exc_info=not isinstance(problem, PedpredError))
            undo()
            return _Done.FAILURE
        return _Done.SUCCESS

    def _configure(self) -> None:
        settings = self._settings({})
        if settings.use_map and NO_MAP.search(topic := self.resolve_topic_name("map")):
            rule = "costs are not a map: remap `map` to the topic of the map server, or set use_map to false"
            raise ConfigError("map", topic, rule)
        people_class = _message_class(settings.people_type)
        _log.info("compiling what is not compiled yet: up to a minute")
        warm_up(settings.folder)
        predictor = OnlinePredictor.load(settings.folder, settings.online())
        rehearse(predictor, settings)
        if settings.place is not None:
            check_output(settings.place)
        is_known = settings.people_type in PEOPLE_FIELDS
        decode = None if is_known else partial(deserialize_message, message_type=people_class)
        self._follower = Follower(predictor, settings, self._has_subscribers, decode_people=decode)
        self._follower.load_place()
        self._latencies, self._diagnosed = Latencies(), Counts()
        self._add_publishers(self._follower)
        if settings.use_map:
            self._subscribe_map(self._follower)
        self._subscribe_transforms()
        people = self.resolve_topic_name("people")
        if people in {one.topic_name for one in (*self._own, *self._sinks.values())}:
            rule = "this node uses it for something else: remap `people` to the topic of the tracker"
            raise ConfigError("people", people, rule)
        self._retry = self._add_timer(_RETRY_S, "people left out", self._publish_outputs)
        self._retry.cancel()  # each wake-up takes about a millisecond, so only while people wait
        self._add_timer(_DIAGNOSTICS_S, _NOT_EMPTIED, self._clear_outputs)
        self._add_timer(_DIAGNOSTICS_S, f"{_DIAGNOSTICS} left out", self._diagnose)
        self._add_timer(_PLACE_S, _NOT_KEPT, self._follower.save_place)

    def _clean_up(self) -> None:
        self._unsubscribe_people()
        for one in self._own:
            (self.destroy_timer if hasattr(one, "timer_period_ns") else self.destroy_subscription)(one)
        for sink in self._sinks.values():
            lasting = isinstance(sink, LifecyclePublisher)
            (self.destroy_lifecycle_publisher if lasting else self.destroy_publisher)(sink)
        self._own, self._sinks, self._follower, self._retry = [], {}, None, None

    # Publishers, subscriptions and timers

    def _add_publishers(self, follower: Follower) -> None:
        for topic, kind in output_types(follower.settings, follower.predictor.protocol.horizon_steps).items():
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
        if _DIAGNOSTICS not in self._sinks:
            made = _message_class(DIAGNOSTICS_TYPE)
            self._sinks[_DIAGNOSTICS] = self.create_publisher(made, _DIAGNOSTICS, 10)

    def _subscribe_map(self, follower: Follower) -> None:
        for qos in (
            _latched(1),
            _best_effort(1),
        ):  # the first gets no volatile map, the second no earlier one
            self._subscribe(GRID_TYPE, "map", self._take_map, qos, _silent_events())
        updates = f"{self.resolve_topic_name('map')}_updates"
        try:
            take = _listener(updates, follower.take_map_update)
            self._subscribe(UPDATE_TYPE, updates, take, _reliable(_UPDATES_DEPTH))
        except ConfigError as problem:
            _log.info("updates of the map are not received: %s", problem)

    def _subscribe_transforms(self) -> None:
        try:
            for topic, qos in {"/tf": _reliable(_TF_DEPTH), "/tf_static": _latched(_TF_DEPTH)}.items():
                take = _listener(topic, partial(self._take_transforms, fixed=topic == "/tf_static"))
                self._subscribe(TRANSFORMS, topic, take, qos)
        except ConfigError as problem:
            _log.warning("people must be in the frame of the map: %s", problem)

    def _subscribe_people(self) -> None:
        assert self._follower is not None
        settings = self._follower.settings
        reliable = settings.people_reliability == "reliable"
        qos = _reliable(_PEOPLE_DEPTH) if reliable else _best_effort(_PEOPLE_DEPTH)
        made = _message_class(settings.people_type)
        self._people = self.create_subscription(made, "people", self._take_people, qos, raw=True)
        about = f"{settings.people_type}, {settings.people_reliability}"
        source, target = map(self.resolve_topic_name, ("people", PREDICTIONS))
        _log.info("forecasting people of %s (%s) on %s", source, about, target)

    def _unsubscribe_people(self) -> None:
        if self._retry is not None:
            self._retry.cancel()
        if self._people is not None:
            guarded(_NOT_EMPTIED, self._clear_outputs)(0.0)
            self.destroy_subscription(self._people)
            self._people = None
            if self._follower is not None:
                self._follower.inbox.clear()
                guarded(_NOT_KEPT, self._follower.save_place)()

    def _subscribe(
        self, kind: str, topic: str, callback: Callable[..., None], qos: QoSProfile, events: Any = None
    ) -> None:
        """Subscribe; without `events`, rclpy logs publishers whose QoS does not fit."""
        made = _message_class(kind)
        self._own.append(
            self.create_subscription(made, topic, callback, qos, event_callbacks=events, raw=True)
        )

    def _add_timer(self, period_s: float, lost: str, callback: Callable[..., None]) -> Any:
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._own.append(self.create_timer(period_s, guarded(lost, callback), clock=steady))
        return self._own[-1]

    # Messages. Callbacks with two arguments also get what the middleware knows of a message.

    def _take_people(self, raw: bytes, info: dict[str, Any]) -> None:
        _listener("people", self._follow)(raw, info["received_timestamp"])

    def _follow(self, raw: bytes, received_ns: int) -> None:
        if self._follower is not None:
            waited_s = max(time.time_ns() - received_ns, 0) / 1e9 if received_ns else 0.0
            clock_ns = self.get_clock().now().nanoseconds
            self._follower.inbox.take_people(raw, clock_ns, time.monotonic(), waited_s)
            self._publish_outputs()

    def _take_map(self, raw: bytes, info: dict[str, Any]) -> None:
        if self._follower is not None:
            _listener("map", self._follower.take_map)(raw, info["source_timestamp"])

    def _take_transforms(self, raw: bytes, fixed: bool) -> None:
        if self._follower is not None:
            self._follower.inbox.take_transforms(raw, self.get_clock().now().nanoseconds / 1e9, fixed)
            if self._follower.inbox.is_waiting:
                self._publish_outputs()

    def _publish_outputs(self) -> None:
        if self._follower is None or self._people is None:
            return
        try:
            for output in self._follower.outputs(time.monotonic()):
                self._publish(output)
                if output.topic == PREDICTIONS:
                    self._latencies.add(time.monotonic() - self._follower.arrived_s)
        finally:
            (self._retry.reset if self._follower.inbox.is_waiting else self._retry.cancel)()

    def _clear_outputs(self, *after_s: float) -> None:
        if self._follower is not None and self._people is not None:
            for output in self._follower.clear_outputs(self.get_clock().now().nanoseconds, *after_s):
                self._publish(output)

    def _publish(self, output: Output) -> None:
        if output.topic in self._sinks:
            self._sinks[output.topic].publish(serialize(output.kind, output.content))  # rclpy takes bytes

    def _has_subscribers(self, topic: str) -> bool:
        return topic in self._sinks and self._sinks[topic].get_subscription_count() > 0

    def _diagnose(self) -> None:
        if self._follower is None:
            return
        publishers = self.get_publishers_info_by_topic(self.resolve_topic_name("people"))
        now_ns, name = self.get_clock().now().nanoseconds, self.get_fully_qualified_name().lstrip("/")
        level, summary = diagnose(
            self._follower,
            time.monotonic(),
            [one.topic_type for one in publishers],
            self._diagnosed,
            self._latencies.median_ms(),
            now_ns,
            self.count_publishers(self.resolve_topic_name(PREDICTIONS)) - 1,
        )
        self._diagnosed = replace(self._follower.counts)
        level, summary = (level, summary) if self._people is not None else (0, "not active")
        values = status_values(self._follower, self._latencies)
        self._publish(
            Output(
                _DIAGNOSTICS,
                DIAGNOSTICS_TYPE,
                diagnostics_content(name, level, summary, values, now_ns),
            )
        )


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
        remedy = f"{package} is not installed or has no {name}: apt install {apt}"
        raise ConfigError("type", kind, remedy) from cause


def _latched(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def _reliable(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth)


def _best_effort(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
