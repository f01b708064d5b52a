"""Stands for tensorboardX in a tracker's process; HOW_TRACKED decides how it goes wrong."""
