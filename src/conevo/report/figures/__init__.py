"""Figures of a report: charts, curves, tiles, and the style they share."""
