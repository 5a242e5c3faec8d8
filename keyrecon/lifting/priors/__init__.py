"""What is known of bodies beforehand: limits, habits, occlusion, learnt depth."""
