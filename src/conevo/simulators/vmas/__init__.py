"""Tasks of VMAS; ``world`` has their entry, the other modules load torch."""
