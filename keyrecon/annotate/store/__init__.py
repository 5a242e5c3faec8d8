"""Every decision of a person, durable, undoable, and mirrored into files that others read."""
