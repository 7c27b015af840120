"""The contract of all forecasters: the request, the forecaster type and rows of methods."""

from pedpred.forecasting.methods import MethodRow
from pedpred.forecasting.request import Forecaster, ForecastRequest

__all__ = ["ForecastRequest", "Forecaster", "MethodRow"]
