"""Analysis: what evolved teams do, read from recorded epochs of finished runs."""
