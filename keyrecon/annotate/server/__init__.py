"""The page's server: who may talk to it, what it answers, long jobs, frames."""
