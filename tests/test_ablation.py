"""Ablations: what they ask for exists, and their points become a picture and a table."""

from pathlib import Path

import pytest
import yaml

from pedpred import config
from pedpred.errors import ConfigError
from pedpred.report.ablation import ablation_figure, ablation_table, point_rows, read_ablation
from pedpred.report.canvas import png_bytes

ROOT = Path(__file__).parents[1]
ABLATIONS = sorted((ROOT / "conf" / "ablations").glob("*.yaml"))
PIPELINE = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]


@pytest.mark.parametrize("path", ABLATIONS, ids=lambda path: path.stem)
def test_every_point_composes_and_differs(path):
    ablation = read_ablation(path)
    composed = [
        config.composed(ROOT / "conf", [*ablation.always, *overrides])
        for overrides in ablation.points.values()
    ]
    assert len(set(composed)) == len(ablation.points)
    written = PIPELINE[ablation.target]["outs"]
    assert ablation.metrics in [next(iter(entry)) for entry in written if isinstance(entry, dict)]


def measured(ablation):
    return {
        point: {
            m: {"ade_m": 0.5 - 0.01 * k, "ade_ci95_m": [0.4, 0.6]}
            for m in ("kalman_cv", "lstm_nogrid", "lstm")
        }
        for k, point in enumerate(ablation.points)
    }


def test_points_become_a_picture_and_a_table():
    ablation = read_ablation(ABLATIONS[0])
    rows = point_rows(ablation, measured(ablation))
    assert len(rows) == len(ablation.points) * 3
    assert rows[0]["overrides"] == [*ablation.always, *ablation.points[rows[0]["point"]]]
    assert png_bytes(ablation_figure(ablation, rows)).startswith(b"\x89PNG")
    lines = ablation_table(ablation, rows).splitlines()
    assert len(lines) == 2 + len(ablation.points)
    assert "0.500 (0.400 to 0.600)" in lines[2]


def test_an_ablation_that_does_not_exist_is_named_beside_those_that_do():
    with pytest.raises(ConfigError, match=r"'ablation' = 'magic': there are \['layouts'"):
        read_ablation(ABLATIONS[0].with_stem("magic"))


def test_a_misspelt_key_is_refused(tmp_path):
    path = tmp_path / "odd.yaml"
    path.write_text(ABLATIONS[0].read_text().replace("entry:", "entyr:"))
    with pytest.raises(ConfigError, match="entyr"):
        read_ablation(path)
