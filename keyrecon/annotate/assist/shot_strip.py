"""The shots of a video for the page, and what a person says of them by a click.

A click is kept until the next run, which takes it over into the project's options; until then the
shots are as they were made.
"""

from keyrecon.annotate.assist.project_cache import ProjectCache
from keyrecon.annotate.assistant import Json
from keyrecon.errors import KeyreconError
from keyrecon.io.workspace import Workspace
from keyrecon.records import PERHAPS, Shots


def project_shots(cache: ProjectCache, workspace: Workspace) -> list[Json]:
    """Every shot with what it shows, and whether it is used now and in the next run."""
    preparation = cache.preparation()
    return [] if preparation is None else list_shots(preparation.shots, workspace)


def list_shots(shots: Shots, workspace: Workspace) -> list[Json]:
    """The same of some shots; nothing where there is but one."""
    if len(shots.parts) == 1:
        return []
    choices = workspace.shot_choices()
    parts = zip(shots.parts, shots.shows, shots.usable, strict=True)
    return [
        {
            "number": number,
            "first": part.start,
            "last": part.stop - 1,
            "shows": shown,
            "unsure": shown == PERHAPS,
            "used": used,
            "wanted": number in choices.use or (used and number not in choices.skip),
        }
        for number, (part, shown, used) in enumerate(parts, 1)
    ]


def choose_shot(cache: ProjectCache, workspace: Workspace, number: int, used: bool) -> list[Json]:
    """Keep whether a shot is used in the next run; the shots anew."""
    listed = project_shots(cache, workspace)
    clicked = next((shot for shot in listed if shot["number"] == number), None)
    if clicked is None:
        raise KeyreconError(f"There is no shot {number}; there are {len(listed)}.")
    workspace.choose_shot(number, None if clicked["used"] == used else used)
    return project_shots(cache, workspace)
