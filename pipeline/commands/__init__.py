"""The commands of `penumbra`, one file each. Only `pipeline.cli` imports them; only they import `reports`.

A command imports its modules when it is called, so that `penumbra --help` need not wait for the renderer.
"""
