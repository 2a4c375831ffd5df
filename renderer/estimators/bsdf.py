"""`bsdf`: proportional to the BRDF times the cosine, as each material samples itself."""

from renderer.estimators.direction_sampling import DirectionSampling, brdf
from renderer.estimators.protocol import ESTIMATORS

ESTIMATORS.add("bsdf", DirectionSampling("bsdf", "proportional to the BRDF", brdf))
