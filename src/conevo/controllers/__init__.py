"""Controllers: from genotypes (numbers) to what a robot does (behaviour)."""
