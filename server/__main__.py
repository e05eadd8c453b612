"""The console script, and `python -m server`: the command, which may be given up while it is still being loaded."""

import sys


def main() -> None:
    """Run the command."""
    try:
        from server.cli import main as run  # takes a second or two
    except KeyboardInterrupt:
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
