"""What belongs to the player: colour model, background model, part labels, contours."""
