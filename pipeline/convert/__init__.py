"""Conversion of Mitsuba 3 and glTF 2.0 scenes to pbrt-v4 text. It lies in `pipeline`, since only a command
uses it.
"""
