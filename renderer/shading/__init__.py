"""What estimators share: choosing lights, BSDF values, visibility, emission."""
