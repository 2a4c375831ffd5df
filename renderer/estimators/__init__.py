"""Estimators: one file each, any scene can be rendered with each that applies."""
