"""`cosine`: proportional to the cosine: the hemisphere form with the cosine taken into the pdf."""

from renderer.estimators.direction_sampling import DirectionSampling, cosine
from renderer.interfaces.estimator import ESTIMATORS

ESTIMATORS.add("cosine", DirectionSampling("cosine", "proportional to the cosine", cosine))
