"""Which frames look alike: edge elements, pose distances, keyframes, joints carried over."""
