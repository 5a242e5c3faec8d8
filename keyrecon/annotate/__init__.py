"""The annotator: a page served on this machine where a person marks keyframes."""
