"""Trust, regions and local errors, each by itself, along the instants of a stream."""

import numpy as np

from pedpred.forecasting.local_errors import LocalErrors
from pedpred.forecasting.postprocessing import PlaceKnowledge, Postprocessing
from pedpred.forecasting.regions import Regions
from pedpred.forecasting.trust import Trust
from pedpred.scenes import Predictions


def place_of(learner):
    """Knowledge of a place that is one learner alone; that of a place stays."""
    if isinstance(learner, PlaceKnowledge):
        return learner
    kinds = Trust, Regions, LocalErrors
    return PlaceKnowledge(*(learner if isinstance(learner, kind) else None for kind in kinds))


def at_instant(place, time_s, person, detection, seen, forecasts):
    """The place after an instant, and the forecasts from it; nobody chooses modes."""
    known = detection, float(time_s), person, detection, seen
    return Postprocessing(together=False).apply(place, forecasts, *known)


def along(learner, person, time_s, detection, seen, forecasts):
    """The place after each instant, and the forecasts from it."""
    place = place_of(learner)
    for now_s in np.unique(time_s):
        rows = np.flatnonzero(time_s == now_s)
        known = now_s, person[rows], detection[rows], seen[rows]
        place, changed = at_instant(place, *known, forecasts.select(rows))
        yield place, changed


def learned(predictions, person, time_s, detection, seen, noise_m=0.0):
    """Forecasts of many instants with regions that learn."""
    regions = Regions.initial(predictions.steps, noise_m)
    instants = along(regions, person, time_s, detection, seen, predictions)
    return Predictions.join([changed for _, changed in instants])
