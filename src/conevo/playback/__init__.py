"""What is to be drawn of a recorded epoch: data that worlds make, and viewer and films draw."""
