"""Input masking: which parts of the inputs are left out, and how often."""

import numpy as np
import pytest
import torch

from pedpred.training.masking import InputMasking, mask
from tests.refused import refused

ROWS = 8000


def masked(**shares):
    """Which of 8000 rows' beams, of their 4 neighbours and of their 5 past positions were masked."""
    inputs = {"state": torch.ones(ROWS, 2), "beams": torch.full((ROWS, 4), 2.5)}
    inputs |= {"neighbours": torch.full((ROWS, 20), 3.5), "history": torch.full((ROWS, 15), 4.5)}
    inputs |= {"track": torch.full((ROWS, 6), 5.5)}
    found = mask(inputs, InputMasking(**shares), {"beams": 7.0}, np.random.default_rng(5))
    assert all(values.shape == inputs[name].shape for name, values in found.items())
    for name in ("state", "track"):
        assert torch.equal(found[name], inputs[name])
    for name, kept, gone in (("beams", 2.5, 7.0), ("neighbours", 3.5, 0.0), ("history", 4.5, 0.0)):
        assert ((found[name] == kept) | (found[name] == gone)).all()
    parts = found["beams"], found["neighbours"].reshape(ROWS, 4, 5), found["history"].reshape(ROWS, 5, 3)
    gone = [part == value for part, value in zip(parts, (7.0, 0.0, 0.0), strict=True)]
    for whole in gone:
        assert (whole == whole[..., :1]).all()
    return gone[0].numpy(), gone[1][..., 0].numpy(), gone[2][..., 0].numpy()


def test_masked_shares_of_rows_and_of_their_parts():
    """map 0.2; neighbours 0.1 of all, and 0.3 of each in half of the rows; the past of 0.4 of the rows.

    A neighbour is gone with 0.1 + 0.9 * 0.5 * 0.3 = 0.235, all four with 0.1 + 0.9 * 0.5 * 0.3^4, none
    with 0.9 (0.5 + 0.5 * 0.7^4). Past position k of 5 is gone with 0.4 k / 5. Deviations are below 0.006.
    """
    missed = {"missed_share": 0.5, "missed": 0.3}
    beams, people, past = masked(map_share=0.2, neighbours_share=0.1, past_share=0.4, **missed)
    assert beams[:, 0].mean() == pytest.approx(0.2, abs=0.02)
    assert people.mean() == pytest.approx(0.235, abs=0.02)
    assert people.all(axis=1).mean() == pytest.approx(0.1 + 0.45 * 0.3**4, abs=0.02)
    assert (~people).all(axis=1).mean() == pytest.approx(0.45 + 0.45 * 0.7**4, abs=0.02)
    np.testing.assert_allclose(people.mean(axis=0), 0.235, atol=0.02)
    np.testing.assert_allclose(past.mean(axis=0), 0.4 * np.arange(5) / 5, atol=0.02)
    assert (past[:, 1:] >= past[:, :-1]).all()
    both = beams[:, 0] & people.all(axis=1)
    assert both.mean() == pytest.approx(0.2 * (0.1 + 0.45 * 0.3**4), abs=0.01)
    assert (beams[:, 0] & past[:, 4]).mean() == pytest.approx(0.2 * 0.32, abs=0.01)


def test_nothing_is_masked_by_default_and_each_share_alone():
    assert not any(part.any() for part in masked())
    assert not any(part.any() for part in masked(missed=1.0))
    assert not any(part.any() for part in masked(missed_share=1.0))
    assert [part.all() for part in masked(map_share=1.0)] == [True, False, False]
    assert [part.all() for part in masked(neighbours_share=1.0)] == [False, True, False]
    assert [part.all() for part in masked(missed_share=1.0, missed=1.0)] == [False, True, False]
    past = masked(past_share=1.0)[2]
    assert not past[:, 0].any()
    np.testing.assert_allclose(past.mean(axis=0), np.arange(5) / 5, atol=0.02)
    with refused("missed"):
        InputMasking(missed=1.1)
