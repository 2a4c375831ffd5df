"""`hemisphere`: uniform over the hemisphere: the lecture's third cure of overflow, at the price of noise."""

from renderer.estimators.direction_sampling import DirectionSampling, uniform
from renderer.interfaces.estimator import ESTIMATORS

ESTIMATORS.add("hemisphere", DirectionSampling("hemisphere", "uniform over the hemisphere", uniform))
