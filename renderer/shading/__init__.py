"""The parts that estimators share: choosing lights, BSDF values, visibility, emission."""
