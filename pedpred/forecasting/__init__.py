"""The contract of everything that forecasts: one question, one kind of answer, and a table of methods."""

from pedpred.forecasting.methods import Method, Methods
from pedpred.forecasting.request import Forecaster, ForecastRequest

__all__ = ["ForecastRequest", "Forecaster", "Method", "Methods"]
