"""Campaigns: plans of runs, executed to the end on one machine or many."""
