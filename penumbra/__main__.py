"""The command `penumbra`, and `python -m penumbra`."""

from __future__ import annotations

import sys

from penumbra.rooms import shadowed


def main() -> None:
    """Run the command line; one line and exit code 2 where another's package hides one of ours."""
    if why := shadowed():
        print(f"penumbra: {why}", file=sys.stderr)
        sys.exit(2)
    from pipeline.cli import main as run

    run()


if __name__ == "__main__":
    main()
