"""Runs: one seeded experiment each, in its own directory; the only place that knows both sides."""
