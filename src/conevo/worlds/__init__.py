"""Worlds: the tasks for which teams are evolved, and the one loop that runs them."""
