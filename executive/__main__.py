"""Entry point of the command ``planlang`` and of ``python -m executive``."""

from executive.cli.app import app


def main() -> None:
    """Run the command; ends the process with its exit code."""
    app(prog_name="planlang")


if __name__ == "__main__":
    main()
