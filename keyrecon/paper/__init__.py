"""The stages as the two papers print them; `choices.md`: what was chosen where they are open."""
