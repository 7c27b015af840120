"""What others report under the protocol of the literature, and why it is not quite comparable."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Published:
    """Errors over 4.8 s, 8 annotations seen and 12 forecast; trained on the other ETH and UCY scenes.

    Attributes:
        name: of the method, with its source.
        errors_m: (ADE, FDE) by place, m.
        remark: what sets it apart from forecasting the native annotations once.
    """

    name: str
    errors_m: dict[str, tuple[float, float]]
    remark: str


_STRETCHED = "its eth file steps by 10 of 15 frames a second, so 12 steps are 8 s there and not 4.8 s"

PUBLISHED = (
    Published(
        "linear fit, in Gupta et al. 2018",
        {"eth": (1.33, 2.94), "hotel": (0.39, 0.72)},
        _STRETCHED,
    ),
    Published(
        "Social LSTM, in Gupta et al. 2018",
        {"eth": (1.09, 2.35), "hotel": (0.79, 1.76)},
        _STRETCHED,
    ),
    Published(
        "Social GAN, 20VP-20 (Gupta et al. 2018)",
        {"eth": (0.87, 1.62), "hotel": (0.67, 1.37)},
        f"{_STRETCHED}; the best of 20 samples counts, chosen with the truth",
    ),
    Published(
        "SR-LSTM-2 (Zhang et al. 2019)",
        {"eth": (0.63, 1.25), "hotel": (0.37, 0.74)},
        "its eth file steps by 6 frames, as annotated; its windows are those of its own loader",
    ),
)
"""m; checked against tables that quote the papers, not against the papers. The eth file of Social GAN is
discussed in the issues of its repository."""
