"""Results on disk: run folders, sealed entries, and the record of what made them."""
