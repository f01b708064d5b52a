"""Two worlds in one arena: pursuit-evasion, and the shaping of its prey."""
