"""Gathering and collective construction: rules, plans and sensors."""
