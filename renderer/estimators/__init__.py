"""Estimators, one technique a file."""
