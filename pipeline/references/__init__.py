"""Reference images: backends that see the scene's description and never our renderer."""
