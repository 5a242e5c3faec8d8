"""Shot by shot: the player followed, joints carried, and usable shots put end to end."""
