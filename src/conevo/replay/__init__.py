"""Replays of a team: recordings, the viewer in the browser, and films."""
