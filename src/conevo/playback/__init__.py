"""Playbacks, the drawings of recorded epochs: worlds make them, viewer and films draw them."""
