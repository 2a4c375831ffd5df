"""`area`: uniform over the light's surface, the area form with its cos cos' / d^2.

Unbounded where d may go to 0.
"""

from renderer.estimators.light_sampling import LightSampling
from renderer.interfaces.estimator import ESTIMATORS

ESTIMATORS.add("area", LightSampling("area", "uniform over the light's surface"))
