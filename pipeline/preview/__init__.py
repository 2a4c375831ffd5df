"""A scene from outside, and what an estimator tries at one pixel."""
