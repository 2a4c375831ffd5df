"""Mitsuba 3 XML to pbrt-v4 text."""
