"""The stages as the two papers print them."""
