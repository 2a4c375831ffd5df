"""Sampling that several kinds of light share."""
