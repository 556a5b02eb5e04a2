"""Load and run the command line; Ctrl-C meanwhile ends the process without a traceback."""

import signal


def main() -> None:
    """Run the command ``ground``."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the command line handles it
    from ground.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
