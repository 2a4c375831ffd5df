"""Samplers: stateless functions of (seed, pixel, sample, dimension), one file each."""
