"""Mitsuba 3 as a reference."""
