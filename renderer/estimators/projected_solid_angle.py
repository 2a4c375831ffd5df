"""`projected-solid-angle`: as the cosine within a polygonal light, so that unshadowed diffuse surfaces have
no noise at all.
"""

from renderer.estimators.light_sampling import LightSampling
from renderer.interfaces.estimator import ESTIMATORS

ESTIMATORS.add(
    "projected-solid-angle",
    LightSampling("projected-solid-angle", "proportional to the cosine over the light", one_sided=True),
)
