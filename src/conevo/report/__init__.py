"""What a campaign shows: claims judged, statistics, tables and figures, on a page and for LaTeX."""
