"""The program itself: ``bodyflight`` after ``pip install``, or ``python -m bodyflight``."""

import sys

from ._native import program


def main() -> None:
    """Runs the command line and exits with its exit code."""
    sys.exit(program(["bodyflight", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
