"""The command ``conevo``."""
