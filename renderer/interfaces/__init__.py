"""The protocols of the plug-ins, each with its registry."""
