"""Intersection of rays and shapes: Embree's triangles, analytic primitives, texture coordinates, bounds."""
