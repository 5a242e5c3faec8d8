"""Which frames look alike, and which few a person annotates (Sections 4.2-4.4)."""
