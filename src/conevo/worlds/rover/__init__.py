"""The multi-rover world: rules, canals and rocks."""
