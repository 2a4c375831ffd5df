"""`bsdf`: proportional to the BRDF times the cosine, as each material samples itself."""

from renderer.estimators.direction_sampling import DirectionSampling
from renderer.estimators.protocol import ESTIMATORS
from renderer.estimators.scattering import sample_material

ESTIMATORS.add("bsdf", DirectionSampling("bsdf", "proportional to the BRDF", sample_material))
