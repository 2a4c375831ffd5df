"""Scores of images, and the parts that metrics share."""
