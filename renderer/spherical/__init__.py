"""Solid angles and maps of the sphere, as functions over arrays that know no lights."""
