"""Closed forms as references."""
