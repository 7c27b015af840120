"""People walking: an animated plan view with past and forecast paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from PIL import Image, ImageDraw, ImageFont

from pedpred.errors import ValueRuleError
from pedpred.evaluation.forecasts import EvaluationWindows
from pedpred.files import atomic_write
from pedpred.report.canvas import FAINT, INK, OBSTACLE
from pedpred.report.methods import Method, Methods
from pedpred.report.plan import obstacle_image, quarter_turns_of, turn_points
from pedpred.scenes import Scene, Trajectories
from pedpred.settings import In, Settings

_PERSON_RADIUS_M = 0.2
_TAIL = "#7FA8C9"
_SMOOTHING = 2
"""Drawn this much larger and averaged down, so that edges are smooth."""
_SHADES = 31
"""Colours of a frame; the next one stands for what does not change."""
_FOOT_PX = 20
_LEAST_WEIGHT, _FAINT = 0.2, 0.4
"""Less likely modes are not drawn; lines of modes have this much of the method's colour."""
LONGEST_GAP = 1.5
"""A person is absent within gaps of a track longer than this many detection intervals."""


@dataclass(frozen=True)
class Animation(Settings):
    """Settings of an animation."""

    method: str  # key of the method whose forecasts are drawn
    duration_s: Annotated[float, In("(0, 3600]")]  # of the stretch, which is shown at its own pace
    frame_s: Annotated[float, In("[0.01, 60]")]  # time between two frames
    tail_s: Annotated[float, In("(0, 3600]")]  # time that the past paths span
    width_px: Annotated[int, In("[16, 10000]")]  # of a frame


def write_animation(
    scene: Scene, windows: EvaluationWindows | None, animation: Animation, methods: Methods, path: Path
) -> None:
    """Write the busiest stretch of a scene as a GIF that repeats; the same input gives the same bytes.

    Without windows it is a still of the empty place.

    Raises:
        ValueRuleError: there are no forecasts of the method, or none at all.
    """
    if windows is None:
        with atomic_write(path) as new:
            _Sheet(scene, animation.width_px).ground.reduce(_SMOOTHING).save(new, "gif")
        return
    if animation.method not in windows.predictions:
        rule = f"scene {scene.name} has forecasts of {sorted(windows.predictions)}"
        raise ValueRuleError("method", animation.method, rule)
    first, *others = _changes(list(_frames(scene, windows, animation, methods[animation.method])))
    lengths_ms = _lengths_ms(1 + len(others), animation.frame_s)
    repeat: dict[str, Any] = {"duration": lengths_ms, "loop": 0, "disposal": 1}
    with atomic_write(path) as new:
        first.save(new, save_all=True, append_images=others, optimize=False, transparency=_SHADES, **repeat)


def _lengths_ms(frames: int, frame_s: float) -> list[int]:
    """How long each frame is shown: a GIF counts hundredths of a second, and their sum keeps the pace."""
    ends = np.round(100 * frame_s * np.arange(frames + 1)).astype(int)
    return (10 * np.diff(ends)).tolist()


def _changes(frames: list[Image.Image]) -> Iterator[Image.Image]:
    """Frames in few colours; pixels that stay as they are become transparent, which packs far better."""
    palette = frames[len(frames) // 2].quantize(_SHADES, dither=Image.Dither.NONE)
    before = None
    for frame in frames:
        image = frame.quantize(palette=palette, dither=Image.Dither.NONE)
        pixels = np.array(image)
        image.putdata(np.where(pixels == before, _SHADES, pixels).ravel().tolist())
        yield image
        before = pixels


def busiest_start(time_s: np.ndarray, duration_s: float) -> float:
    """Find the begin of the stretch of `duration_s` that holds most of the times; the earliest such.

    Raises:
        ValueRuleError: there are no times.
    """
    if not len(time_s):
        raise ValueRuleError("windows", 0, "there must be forecasts to show")
    time_s = np.sort(time_s)
    ends = np.searchsorted(time_s, time_s + duration_s, side="right")
    return float(time_s[np.argmax(ends - np.arange(len(time_s)))])


def positions_at(trajectories: Trajectories, time_s: float, longest_gap_s: float) -> dict[int, np.ndarray]:
    """Interpolate everybody's position (m, world, [2]) at an instant between two detections.

    A track counts as absent within gaps longer than `longest_gap_s`.
    """
    slack_s = 1e-6
    near = np.abs(trajectories.time_s - time_s) <= longest_gap_s + slack_s
    positions = {}
    for track in np.unique(trajectories.track_id[near]):
        mine = near & (trajectories.track_id == track)
        clock, position = trajectories.time_s[mine], trajectories.position[mine]
        after = int(np.searchsorted(clock, time_s - slack_s))
        before = int(np.searchsorted(clock, time_s + slack_s, side="right")) - 1
        if before < 0 or after == len(clock) or clock[after] - clock[before] > longest_gap_s + slack_s:
            continue
        positions[int(track)] = np.array([np.interp(time_s, clock, axis) for axis in position.T])
    return positions


class _Sheet:
    """A plan of the scene in pixels."""

    def __init__(self, scene: Scene, width_px: int):
        self.turns = quarter_turns_of(scene.camera)
        image, (left, right, bottom, top) = obstacle_image(scene.occupancy, self.turns)
        self.scale = _SMOOTHING * width_px / (right - left)
        self.corner = np.array([left, top])
        size = (_SMOOTHING * width_px, round(self.scale * (top - bottom)))
        blocked = Image.fromarray(image[::-1]).resize(size, Image.Resampling.NEAREST)
        self.ground = Image.new("RGB", (size[0], size[1] + _SMOOTHING * _FOOT_PX), "white")
        self.ground.paste(OBSTACLE, mask=blocked.crop((0, 0, *self.ground.size)))
        draw = ImageDraw.Draw(self.ground)
        draw.rectangle((0, 0, size[0] - 1, size[1]), outline=FAINT, width=_SMOOTHING)
        self.foot = size[1] + _SMOOTHING * _FOOT_PX / 2
        draw.line([10, self.foot, 10 + 2 * self.scale, self.foot], INK, 2 * _SMOOTHING)
        self.write(draw, 16 + 2 * self.scale, "2 m")

    def pixels(self, points: np.ndarray) -> list[tuple[float, float]]:
        """World points (m, [n, 2]) as (column, row)."""
        at = (turn_points(points, self.turns) - self.corner) * [self.scale, -self.scale]
        return [(float(x), float(y)) for x, y in at]

    def write(self, draw: ImageDraw.ImageDraw, column: float, text: str) -> None:
        """Words below the plan."""
        font = ImageFont.load_default(11 * _SMOOTHING)
        draw.text((column, self.foot), text, INK, font, anchor="lm")


def _interval_s(windows: EvaluationWindows) -> float:
    """Usual time between two forecasts of a person, s: a forecast is drawn until the next one."""
    order = np.lexsort((windows.time_s, windows.track_id))
    gaps_s = np.diff(windows.time_s[order])[np.diff(windows.track_id[order]) == 0]
    return float(np.median(gaps_s)) if len(gaps_s) else windows.dt_s


def _frames(
    scene: Scene, windows: EvaluationWindows, animation: Animation, method: Method
) -> Iterator[Image.Image]:
    """One picture per instant."""
    sheet = _Sheet(scene, animation.width_px)
    trajectories = scene.trajectories
    start_s, renewed_s = busiest_start(windows.time_s, animation.duration_s), _interval_s(windows)
    predictions = windows.predictions[method.key]
    horizon_s = predictions.steps * predictions.dt_s
    for time_s in start_s + np.arange(0.0, animation.duration_s, animation.frame_s):
        picture = sheet.ground.copy()
        draw = ImageDraw.Draw(picture)
        here = positions_at(trajectories, time_s, LONGEST_GAP * scene.detection_dt_s)
        behind = (trajectories.time_s <= time_s) & (trajectories.time_s >= time_s - animation.tail_s)
        for track, position in here.items():
            tail = trajectories.position[behind & (trajectories.track_id == track)]
            draw.line(sheet.pixels(np.vstack([tail, position])), _TAIL, 2 * _SMOOTHING)
        latest = (windows.time_s <= time_s + 1e-6) & (windows.time_s > time_s - renewed_s + 1e-6)
        rows = np.flatnonzero(latest & np.isin(windows.track_id, list(here)))
        _draw_forecasts(draw, sheet, windows, rows, method)
        for x, y in sheet.pixels(np.array([*here.values()]).reshape(-1, 2)):
            draw.circle((x, y), _PERSON_RADIUS_M * sheet.scale, INK)
        caption = f"{scene.name}, t = {time_s:.1f} s, dots: {method.label}, the next {horizon_s:g} s"
        sheet.write(draw, 60 * _SMOOTHING + 2 * sheet.scale, caption)
        yield picture.reduce(_SMOOTHING)


def _draw_forecasts(
    draw: ImageDraw.ImageDraw, sheet: _Sheet, windows: EvaluationWindows, rows: np.ndarray, method: Method
) -> None:
    """Likely modes as broad pale lines, and above them point forecasts as thin lines with dots."""
    predictions, here = windows.predictions[method.key], windows.position
    red, green, blue = (1 - _FAINT * (1 - part) for part in to_rgb(method.colour))
    for row, mode in product(rows, range(predictions.modes if predictions.modes > 1 else 0)):
        weight = predictions.weight[row, mode]
        if weight >= _LEAST_WEIGHT:
            way = sheet.pixels(np.vstack([here[row], predictions.path[row, mode]]))
            draw.line(way, to_hex((red, green, blue)), round((1 + 5 * weight) * _SMOOTHING), joint="curve")
    for row in rows:
        path = sheet.pixels(np.vstack([here[row], predictions.point[row]]))
        draw.line(path, method.colour, _SMOOTHING)
        for x, y in path[1:]:
            draw.circle((x, y), 1.6 * _SMOOTHING, method.colour)
