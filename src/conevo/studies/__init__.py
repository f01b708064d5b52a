"""What a finished team does: behaviours, lesions, clones, exchanged places, and how repeatable its fitness is."""
