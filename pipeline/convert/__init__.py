"""Conversion of Mitsuba 3 and glTF 2.0 scenes to pbrt-v4 text."""
