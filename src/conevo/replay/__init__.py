"""Seeing the team: trajectories, the viewer in the browser, films, and a page that follows runs."""
