"""The study of the pursuit world: behaviour and sensing of predators in recorded epochs."""
