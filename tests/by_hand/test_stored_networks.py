"""Networks on disk and as graphs: settings, checkpoints, one exported step, weights in half precision."""

import numpy as np
import onnx
import onnx.numpy_helper
import onnxruntime
import pytest
import torch

from pedpred.errors import InputError, ValueRuleError
from pedpred.features import ForecastProtocol
from pedpred.models.export import ExportedStep, export_onnx, store_half
from pedpred.models.features import RowFormat
from pedpred.models.forecaster import forecaster
from pedpred.models.lstm.autoencoder import GridAutoencoder, GridEncoder
from pedpred.models.lstm.features import LstmFeatures
from pedpred.models.lstm.network import LstmSettings
from pedpred.models.mixture.network import MixtureSettings
from pedpred.models.registry import (
    describe_network,
    is_network,
    load_network,
    parse_settings,
    plain_settings,
    settings_class,
)
from pedpred.storage.checkpoints import write_checkpoint
from tests.exported import lstm
from tests.refused import refused
from tests.toys.architecture import ToyNetwork, ToySettings

STEPS = 3
SMALL = lstm(4, 5, {"grid": (3, 2), "state": (2, 3)}, dropout=0.5)
MADE_WITH = RowFormat(ForecastProtocol(dt_s=0.4, horizon_steps=STEPS), "lstm", LstmFeatures(16, 0.3, 3, 5.0))


def small():
    torch.manual_seed(5)
    return SMALL.build({"state": 2, "grid": 32}, STEPS)


def test_settings_are_parsed_by_their_architecture():
    for name, kind in (("lstm", LstmSettings), ("mixture", MixtureSettings)):
        assert settings_class(name) is kind
    plain = plain_settings(SMALL)
    assert plain["architecture"] == "lstm"
    assert (plain["joint"], plain["head"], plain["dropout"]) == (4, 5, 0.5)
    assert plain["channels"] == {"state": {"projection": 2, "lstm": 3}, "grid": {"projection": 3, "lstm": 2}}
    assert parse_settings(plain) == SMALL
    assert plain["architecture"] == "lstm"  # is not taken out of the caller's dictionary
    mixture = MixtureSettings.parse({"modes": 6, "units": 8})
    assert plain_settings(mixture)["architecture"] == "mixture"
    assert parse_settings(plain_settings(mixture)) == mixture
    for wrong in ({}, {"architecture": "gru"}, ["lstm"]):
        with pytest.raises(ValueRuleError):
            parse_settings(wrong)


def test_a_network_on_disk_is_described_and_read(tmp_path):
    network = small()
    about = describe_network(network, MADE_WITH)
    assert about == {
        "kind": "motion", "network": plain_settings(SMALL), "widths": {"state": 2, "grid": 32},
        "horizon_steps": STEPS, "rows": MADE_WITH.plain(),
    }  # fmt: skip
    assert is_network(about)
    assert not is_network({"kind": "autoencoder"})
    write_checkpoint(tmp_path, network.state_dict(), about)
    other, made_with = load_network(tmp_path)
    assert made_with == MADE_WITH
    assert not other.training
    assert (other.settings, other.widths, other.horizon_steps) == (SMALL, network.widths, STEPS)
    assert other.state_dict().keys() == network.state_dict().keys()
    for name, weights in network.state_dict().items():
        assert torch.equal(other.state_dict()[name], weights)
    write_checkpoint(tmp_path, network.state_dict(), {"kind": "motion"})
    with pytest.raises(InputError, match=r"about\.json"):
        load_network(tmp_path)


def test_a_forecaster_has_the_encoder_that_its_network_reads(tmp_path):
    encoder = GridAutoencoder(16, 6)
    about = {"kind": "autoencoder", "settings": {"latent": 6}, "cells": 16}
    write_checkpoint(tmp_path / "encoder", encoder.state_dict(), about)
    write_checkpoint(tmp_path / "network", small().state_dict(), describe_network(small(), MADE_WITH))
    found = forecaster(tmp_path / "network", tmp_path / "encoder", together=False, trust=True)
    assert (found.together, found.learning, found.trust) == (False, True, True)
    assert found.features == MADE_WITH.features
    assert torch.equal(found.encoder.conv2.weight, encoder.encoder.conv2.weight)
    blind = lstm(4, 5, {"state": (2, 3)}).build({"state": 2}, STEPS)
    write_checkpoint(tmp_path / "blind", blind.state_dict(), describe_network(blind, MADE_WITH))
    plain = forecaster(tmp_path / "blind", tmp_path / "nowhere")
    assert plain.encoder is None
    assert (plain.together, plain.learning, plain.trust) == (True, True, False)


def exported_inputs(people):
    """State, crop, and the memory in the order of the network's state."""
    rng = np.random.default_rng(people)
    values = [rng.normal(size=(people, 2)), rng.random((people, 16, 16)) < 0.4]
    sizes = [(people, *size) for size in small().state_shapes.values()]
    return [np.asarray(v, np.float32) for v in [*values, *(rng.normal(size=size) for size in sizes)]]


@pytest.mark.parametrize("dt_s", [0.3, 0.4])
def test_an_exported_step_is_encoder_network_and_answer(dt_s):
    """Outputs first, in the order of `TENSORS`, then the state; the toy's path is the sum of dt v."""
    network, encoder = small(), GridEncoder(16, 3)
    step = ExportedStep(network, encoder, dt_s)
    assert not network.training
    assert step.inputs == ("state", "crop")
    values = [torch.from_numpy(v) for v in exported_inputs(3)]
    found = step(*values)
    state = dict(zip(network.state_shapes, values[2:], strict=True))
    outputs, after = network.step({"state": values[0], "grid": encoder.embedding(values[1])}, state)
    assert len(found) == 7
    for one, other in zip(found, [outputs["velocities"], *(after[name] for name in state)], strict=True):
        np.testing.assert_array_equal(one.detach(), other.detach())
    with pytest.raises(ValueError, match="zip"):
        step(*values, values[0])  # a tensor too many
    torch.manual_seed(0)
    walker = ToySettings(4, ("state", "angular")).build({"state": 2, "angular": 3}, STEPS)
    x = np.array([[0.5, -1.0, 0.2, 0.3, 0.9]], np.float32)
    answer, _ = ExportedStep(walker, encoder, dt_s).advance(  # whose encoder it does not need
        torch.from_numpy(x[:, :2]), torch.from_numpy(x[:, 2:]), torch.zeros(1, 1, 4)
    )
    assert list(answer) == ["velocities", "path", "weight"]
    w = {name: weights.detach().numpy() for name, weights in walker.named_parameters()}
    velocities = np.tanh(x @ w["read.weight"].T + w["read.bias"]) @ w["out.weight"].T + w["out.bias"]
    path = dt_s * np.cumsum(velocities.reshape(STEPS, 2), axis=0)
    np.testing.assert_allclose(answer["path"][0, 0].detach(), path, atol=1e-6)


def test_a_graph_computes_the_step_for_any_number_of_people(tmp_path):
    """Also with weights stored in half precision, which are rounded and then used as single precision."""
    network, encoder, path = small(), GridEncoder(16, 3), tmp_path / "network.onnx"
    ends = export_onnx(network, encoder, MADE_WITH.features.shapes(), 0.4, path)
    memory = network.state_shapes
    assert ends == {"inputs": ("state", "crop"), "memory": memory, "outputs": {"velocities": (STEPS, 2)}}
    names = ["state", "crop", *memory]
    session = onnxruntime.InferenceSession(str(path))
    assert [end.name for end in session.get_inputs()] == names
    assert {end.shape[0] for end in [*session.get_inputs(), *session.get_outputs()]} == {"people"}
    assert [end.name for end in session.get_outputs()] == ["velocities", *(f"{name}_next" for name in memory)]

    def compare(atol):
        for people in (1, 4):
            values = exported_inputs(people)
            found = onnxruntime.InferenceSession(str(path)).run(None, dict(zip(names, values, strict=True)))
            expected = ExportedStep(network, encoder, 0.4)(*map(torch.from_numpy, values))
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_allclose(one, other.detach(), atol=atol)

    compare(1e-5)
    assert [one.version for one in onnx.load(path).opset_import] == [17]
    whole = {one.name: onnx.numpy_helper.to_array(one) for one in onnx.load(path).graph.initializer}
    store_half(path)
    stored = {one.name: onnx.numpy_helper.to_array(one) for one in onnx.load(path).graph.initializer}
    floats = {name: values for name, values in whole.items() if values.dtype == np.float32}
    assert len(stored) == len(whole) >= len(floats) > 5
    for name, values in floats.items():
        assert stored[f"{name}.half"].dtype == np.float16
        np.testing.assert_array_equal(stored[f"{name}.half"], values.astype(np.float16))
    with torch.no_grad():
        for weights in [*network.parameters(), *encoder.parameters()]:
            weights.copy_(weights.half().float())
    compare(1e-5)


class Crowded(ToyNetwork):
    """Everybody is slower the more people there are, which tracing takes for a fixed number."""

    def decode(self, outputs, dt_s):
        return {"velocities": outputs["velocities"] / len(outputs["velocities"])}


def test_a_graph_that_is_wrong_for_other_crowds_is_refused(tmp_path):
    network = Crowded(ToySettings(4), {"state": 2}, STEPS)
    with refused("graph"):
        export_onnx(network, None, {"state": (2,)}, 0.3, tmp_path / "network.onnx")
    assert not (tmp_path / "network.onnx").exists()
