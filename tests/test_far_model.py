"""A model of another time step and horizon: 12 steps of 0.4 s, from the predictor to files and planners."""

import json

import numpy as np
import pandas as pd
import pytest

from pedpred.command import main
from pedpred.features import ForecastProtocol
from pedpred.online import OnlinePredictor
from pedpred.ros.planning import prediction_rows
from tests.exported import export_mixture

PROTOCOL = ForecastProtocol(dt_s=0.4, horizon_steps=12)
AHEAD_S = 0.4 * np.arange(1, 13)


@pytest.fixture(scope="module")
def far(tmp_path_factory):
    return export_mixture(tmp_path_factory.mktemp("far"), PROTOCOL)[0]


@pytest.fixture
def walks(tmp_path):
    """Three people every 0.4 s for 10 s as `frame id x y`, ten frames apart; they wander."""
    rng, lines = np.random.default_rng(0), []
    for person, start in enumerate(([0, 0], [3, 1], [-2, 4]), 5):
        path = start + np.cumsum(rng.normal([0.4, 0.1], 0.05, (26, 2)), axis=0)
        lines += [f"{10 * k}\t{person}\t{x:.4f}\t{y:.4f}" for k, (x, y) in enumerate(path)]
    file = tmp_path / "square.txt"
    file.write_text("\n".join(lines) + "\n")
    return file


def test_the_predictor_and_planners_get_its_steps(far):
    robot = OnlinePredictor.load(far)
    for k in range(10):
        forecast = robot.update(0.1 * k, [1, 2], [[0.12 * k, 0.0], [2.0, 0.1 * k]])
    assert (forecast.predictions.steps, forecast.predictions.dt_s) == (12, 0.4)
    assert forecast.position.shape == (2, 12, 2)
    rows = prediction_rows(forecast.track_id, forecast.predictions)
    np.testing.assert_allclose(np.unique(rows["time_s"]), AHEAD_S, rtol=1e-6)
    assert rows["step"].max() == 12
    assert (np.linalg.eigvalsh(forecast.predictions.covariance) > 0).all()
    np.testing.assert_allclose(forecast.predictions.weight.sum(axis=1), 1.0)


def test_forecasts_in_a_table_have_its_steps(far, walks, tmp_path):
    out = tmp_path / "forecasts.csv"
    main(["predict", str(walks), "--rate", "25", "--model", str(far), "-o", str(out)])
    table = pd.read_csv(out)
    assert sorted(table["step"].unique()) == list(range(1, 13))
    own, figures = ["evaluate", str(walks), "--rate", "25"], tmp_path / "e.json"
    main([*own, "--model", str(far), "--forecasts", str(out), "--json", str(figures)])
    found = json.loads(figures.read_text())["square"]
    assert found["forecasts"]["ade_m"] == pytest.approx(found["network"]["most_likely_ade_m"], abs=1e-4)


def straight_on(walks, out):
    """Write the forecasts of constant velocity at all instants."""
    table, rows = pd.read_csv(walks, sep="\t", names=["frame", "id", "x", "y"]), []
    for person, path in table.groupby("id"):
        place = path[["x", "y"]].to_numpy()
        for k in range(1, len(place)):
            steps = np.arange(1, 13)
            going = place[k] + np.outer(steps, place[k] - place[k - 1])
            rows += [(person, 0.4 * k, 0, 1.0, s, *xy) for s, xy in zip(steps, going, strict=True)]
    columns = ["track", "time", "mode", "weight", "step", "x", "y"]
    pd.DataFrame(rows, columns=columns).to_csv(out, index=False)


def test_the_literature_protocol_measures_models_and_files(far, walks, tmp_path, capsys):
    straight_on(walks, tmp_path / "theirs.csv")
    figures = tmp_path / "e.json"
    own = ["evaluate", str(walks), "--rate", "25", "--protocol", "eth-ucy", "--json", str(figures)]
    main([*own, "--model", str(far), "--forecasts", str(tmp_path / "theirs.csv")])
    found = json.loads(figures.read_text())["square"]
    assert set(found) == {"cv", "ca", "kalman_cv", "network", "theirs"}
    assert {row["windows"] for row in found.values()} == {3 * (26 - 19)}
    for key in ("ade_m", "fde_m"):
        assert found["theirs"][key] == pytest.approx(found["cv"][key], abs=1e-6)
    assert found["network"]["best_ade_m"] <= found["network"]["most_likely_ade_m"]
    assert "best_ade_m" not in found["cv"]
    assert "collision_share" in found["cv"]
    main([*own, "--alone"])
    assert "collision_share" not in json.loads(figures.read_text())["square"]["cv"]
    assert "square: 21 windows of 8 + 12 annotations" in capsys.readouterr().out


def test_a_model_or_a_recording_of_other_steps_is_refused_by_it(walks, model):
    own = ["evaluate", str(walks), "--protocol", "eth-ucy", "--rate"]
    for wrong in (["25", "--model", str(model[0])], ["10"]):
        with pytest.raises(SystemExit):
            main([*own, *wrong])
