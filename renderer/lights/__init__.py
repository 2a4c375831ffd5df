"""Lights: one file a kind, each with its sampling techniques side by side."""
