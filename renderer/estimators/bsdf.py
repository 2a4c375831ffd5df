"""`bsdf`: proportional to the BRDF times the cosine, as each material samples itself."""

from renderer.estimators.direction_sampling import DirectionSampling
from renderer.interfaces.estimator import ESTIMATORS
from renderer.shading.bsdf import sample_bsdf

ESTIMATORS.add("bsdf", DirectionSampling("bsdf", "proportional to the BRDF", sample_bsdf))
