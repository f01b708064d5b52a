"""Tasks of JaxMARL as worlds; see ``world``."""
