"""Pictures of a scene from outside, with the samples of an estimator at one pixel."""
