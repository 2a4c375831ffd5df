"""Mathematics of solid angles and of maps of the sphere: functions over arrays, no lights."""
