"""Shading that estimators share: choice of lights, BSDF values, visibility, emission."""
