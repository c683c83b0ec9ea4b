"""Entry point of ``python -m executive``, which is the command ``planlang``."""

from planlang_command import main

if __name__ == "__main__":
    main()
