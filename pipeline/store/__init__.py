"""Results on disk: run folders, sealed folders, and provenance."""
