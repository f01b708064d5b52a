"""Where runs are executed: here one after another, in processes, on a Ray cluster."""
