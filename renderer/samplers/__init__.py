"""Samplers, one a file: stateless functions of (seed, pixel, sample, dimension)."""
