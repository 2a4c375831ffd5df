"""Pydantic models of the JSON files of a run and the TOML files of sweeps."""
