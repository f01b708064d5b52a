"""Worlds: the tasks that teams are evolved for, and the one loop that runs them."""
