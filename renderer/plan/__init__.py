"""Which effects a scene calls for, why, and what is proved to be nothing."""
