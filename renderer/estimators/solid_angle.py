"""`solid-angle`: uniform in the solid angle that the light subtends; its pdf carries the 1/d^2, so weights
stay bounded.
"""

from renderer.estimators.light_sampling import LightSampling
from renderer.interfaces.estimator import ESTIMATORS

ESTIMATORS.add("solid-angle", LightSampling("solid-angle", "uniform in the light's solid angle"))
