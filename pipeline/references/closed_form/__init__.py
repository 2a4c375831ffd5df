"""Images by formula and quadrature, as references."""
