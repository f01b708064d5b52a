"""Seeing the team: trajectories, the viewer in the browser, and films."""
