"""The default model folder, which is part of the wheel."""

from __future__ import annotations

from pathlib import Path

from pedpred.errors import InputError

_INSTALLED = Path(__file__).parent / "default"
_CHECKOUT = Path(__file__).parents[2] / "models" / "online" / "default"


def default_model() -> Path:
    """Return the folder of the default model: in the installed package, else in the checkout.

    Raises:
        InputError: neither has one.
    """
    for folder in (_INSTALLED, _CHECKOUT):
        if folder.is_dir():
            return folder
    remedy = "Name a model folder, or get the default one with git"
    raise InputError(_CHECKOUT, "model folder", "the default model is missing", remedy)
