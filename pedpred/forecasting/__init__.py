"""The contract of all forecasters: the request, the forecaster type and the table of methods."""

from pedpred.forecasting.methods import Method, Methods
from pedpred.forecasting.request import Forecaster, ForecastRequest

__all__ = ["ForecastRequest", "Forecaster", "Method", "Methods"]
