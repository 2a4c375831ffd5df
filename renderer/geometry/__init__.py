"""Where rays meet shapes: Embree's triangles, analytic primitives, texture coordinates, bounds."""
