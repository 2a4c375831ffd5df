"""Pydantic models of what is written as JSON and read from TOML."""
