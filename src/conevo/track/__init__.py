"""Runs in TensorBoard, Weights & Biases and MLflow, sent by a process of their own.

A tracker reads what a run writes. It never writes into the run's directory, and the run does not
know of it: whatever happens to a tracker, the run's files are the same bytes.
"""
