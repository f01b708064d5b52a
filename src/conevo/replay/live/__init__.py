"""A local page that follows runs: what stands in their files, and the server that tells it."""
