"""Every decision of a person, durable, undoable, and shown in files that others read."""
