"""glTF 2.0 to pbrt-v4 text."""
