"""``python -m conevo`` is the command ``conevo``."""

from conevo.cli.main import main

if __name__ == "__main__":
    main()
