"""The commands of `penumbra`, a file each; only `pipeline.cli` imports them, and they alone import `reports`.

A command imports what it needs when it is called: `penumbra --help` would else wait for the renderer.
"""
