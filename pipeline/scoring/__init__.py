"""Scores of images, and what metrics share."""
