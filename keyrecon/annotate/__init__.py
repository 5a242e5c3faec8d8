"""The annotator: a page served on this machine where a person marks keyframes.

What a person decides is a sheet of cells (cells.py). The page sends edits (edits.py); those that
fit (judging.py) go into a journal on the disk (journal.py), from which the state and undo follow
(history.py), and are shown in annotations.json and picks.json (mirror.py, files.py). store.py
holds this together. Around it: exact pictures (stills.py), long work (jobs.py), news for all
pages (events.py), other programs' files (exchange.py), and what keyrecon.assist computes
(assistant.py). server.py has the route table, questions.py the answers, guard.py lets nobody else
in. The page itself is in page/.
"""
