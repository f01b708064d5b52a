"""Tasks of PettingZoo; ``world`` has their entry, ``episodes`` plays them in worker processes."""
