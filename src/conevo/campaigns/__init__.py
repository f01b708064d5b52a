"""Campaigns: a plan of runs, carried out to the end by whatever machines there are."""
