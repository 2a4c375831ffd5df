"""What is written as JSON and read from TOML: pydantic models."""
