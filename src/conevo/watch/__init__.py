"""A local page that follows runs: the state of their files, and its server."""
