"""Vectors, maps of the unit square, piecewise distributions: functions over arrays."""
