"""A study: all forecasters drive the same episodes at a place; table, figures, and episodes to show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pedpred.driving.episodes import DriveSettings
from pedpred.driving.figures import figures_of
from pedpred.driving.forecasters import NAMES
from pedpred.driving.places import REACTIONS, Places, Recording, Worlds
from pedpred.driving.runs import Models, Runner
from pedpred.driving.shown import as_scene, choose_episodes, describe, write_drive
from pedpred.driving.table import Condition, Row, write_table
from pedpred.errors import ValueRuleError
from pedpred.files import write_json
from pedpred.settings import (
    LARGEST_SEED,
    In,
    Settings,
    check_choice,
)
from pedpred.storage.scenes import read_scene, scene_folders, write_scene

NO_WORLD = "none"
_NETWORK, _SIMPLE, _BEST = "modes", "kalman", "true_future"
RECORDED = "helps"
"""Kind of the episode whose forecasts are kept, too: recordings are large."""
_BLOCK = 2  # episodes that one worker drives one after the other


@dataclass(frozen=True)
class StudyPlace(Settings):
    """Where robots drive.

    Attributes:
        input: folder of a scene; it does not matter for simulated worlds.
        world: kind of simulated worlds; `none`: the scene.
        people: whether simulated people react to the robot.
        model: folder of the network whose modes the robot reads.
        lstm: folder of a network that is compared with it.
    """

    input: str
    world: str
    people: str
    model: str
    lstm: str

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("people", self.people, REACTIONS)
        if self.world != NO_WORLD:
            self.worlds()

    def worlds(self) -> Worlds:
        """The simulated worlds."""
        return Worlds(self.world, self.people == REACTIONS[0])

    def places(self) -> Places | None:
        """Where episodes are drawn; None if the recording is missing.

        Raises:
            InputError: the scene is damaged.
        """
        if self.world != NO_WORLD:
            return self.worlds()
        scene = read_scene(scene_folders(Path(self.input))[0])
        return None if scene.unavailable else Recording(scene)

    def models(self) -> Models:
        """The networks."""
        return Models(Path(self.model), {"lstm": Path(self.lstm)})


@dataclass(frozen=True)
class StudySettings(Settings):
    """Which drives are done.

    Attributes:
        episodes: of each place.
        risks: limits of the probability to overlap somebody.
        methods: forecasters, beside the LSTM.
        seed: of episodes and sensor.
        places: by name.
    """

    episodes: Annotated[int, In("[1, 1000000]")]
    risks: Annotated[tuple[float, ...], In("[0, 1)")]
    methods: tuple[str, ...]
    seed: Annotated[int, In(f"[0, {LARGEST_SEED}]")]
    places: Mapping[str, StudyPlace]

    def __post_init__(self) -> None:
        super().__post_init__()
        for method in self.methods:
            check_choice("methods", method, NAMES)
        if missing := {_SIMPLE, _NETWORK} - set(self.methods):
            raise ValueRuleError("methods", self.methods, f"{', '.join(sorted(missing))} is shown: name it")

    def blocks(self) -> list[range]:
        """Numbers of the episodes, some for each job."""
        return [range(n, min(n + _BLOCK, self.episodes)) for n in range(0, self.episodes, _BLOCK)]


def drive_block(settings: StudySettings, name: str, numbers: Sequence[int]) -> list[Row]:
    """Drive some episodes at a place with all methods; no rows if its recording is missing.

    The job of one worker.
    """
    runner = _runner(settings, name)
    if runner is None:
        return []
    asked = settings.places[name].models().conditions(settings.methods, settings.risks)
    return [row for number in numbers for row in runner.rows(number, asked)[0]]


def _runner(settings: StudySettings, name: str) -> Runner | None:
    place = settings.places[name]
    places = place.places()
    return None if places is None else Runner(places, DriveSettings(seed=settings.seed), place.models())


def write_study(settings: StudySettings, name: str, rows: Sequence[Row], drives: Path, metrics: Path) -> None:
    """Write what is known of the drives at a place.

    Args:
        settings: of the study.
        name: of the place.
        rows: of all its episodes.
        drives: folder of `table.csv`, `shown.json`, scenes of the shown drives, and their recordings.
        metrics: JSON file of the figures; without rows it is empty.
    """
    drives.mkdir(parents=True, exist_ok=True)
    write_table(drives / "table.csv", rows)
    write_json(metrics, figures_of(rows) if rows else {})
    write_json(drives / "shown.json", _write_shown(settings, name, rows, drives) if rows else {})


def _write_shown(settings: StudySettings, name: str, rows: Sequence[Row], drives: Path) -> dict[str, Any]:
    """Drive the shown episodes again and write them; the descriptions of their drives by kind."""
    risk, runner = settings.risks[len(settings.risks) // 2], _runner(settings, name)
    shown: dict[str, Any] = {}
    assert runner is not None
    network, simple = (Condition(method, risk) for method in (_NETWORK, _SIMPLE))
    best = [Condition(_BEST, 0.0)] if _BEST in settings.methods else []
    for kind, number in choose_episodes(rows, network, simple).items():
        place, episode = runner.places.draw(number, runner.settings)
        abouts = []
        for condition in (simple, network, *best):
            recorded = kind == RECORDED and condition == network
            done = runner.driven(place, episode, condition, keep=recorded)
            scene = as_scene(done, place, episode)
            write_scene(scene, drives / f"{kind}_{condition.method}")
            abouts.append(describe(done, episode, condition, runner.settings.robot))
            if recorded:
                path = drives / f"{kind}.mcap"
                write_drive(done, scene, episode, _NETWORK, runner.predictor.protocol, path)
        shown[kind] = {"episode": number, "drives": abouts}
    return shown
