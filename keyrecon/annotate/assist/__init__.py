"""What the annotator shows that must be computed: pure functions on the project's records."""
