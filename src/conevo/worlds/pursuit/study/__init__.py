"""The study of the pursuit world: what predators do and sense, told from recorded epochs."""
