"""Joints propagated from the keyframes to every frame (Section 5, taken further)."""
