"""What is known of bodies before a picture is looked at: limits, habits, occlusion, learnt depth."""
