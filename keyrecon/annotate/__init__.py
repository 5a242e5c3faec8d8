"""The annotator: a page served on this machine where a person marks keyframes.

`store`: what a person decides, as a sheet of cells. The page sends edits; those that fit go into a
journal on the disk, from which the state and undo follow, and are shown in annotations.json and
picks.json, which other programs may change too. `server`: routes, who may use them, exact frames,
long work, and news for all open pages. `assist`: what is computed while a person marks; the server
knows it only as an `Assistant`. `page`: the scripts in the browser.
"""
