"""What a finished team does: its behaviours, lesions, clones, and how repeatable fitness is."""
