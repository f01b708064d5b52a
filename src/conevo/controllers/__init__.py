"""Controllers: from genotypes (numbers) to the behaviour of a robot."""
