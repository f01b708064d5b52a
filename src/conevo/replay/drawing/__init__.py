"""What a film's frame is painted with: planes and masks, the world, the timeline, the letters."""
