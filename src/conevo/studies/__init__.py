"""Studies of a finished team: behaviours, lesions, clones, and how repeatable fitness is."""
