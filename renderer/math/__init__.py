"""Vectors, maps of the unit square, noise and piecewise distributions, as functions over arrays."""
