"""Parts of a film's frame: masks, the world, the timeline, the panel of a team."""
