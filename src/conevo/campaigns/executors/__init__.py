"""Executors of runs: one after another here, in processes, or on a Ray cluster."""
