"""`keyrecon ground`: the camera over level ground, where there is no court."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from keyrecon.app.placing import (
    most_tilt_error,
    outdated_report_lines,
    place_stored_motion,
    touch_after,
)
from keyrecon.errors import KeyreconError, counted, quoted
from keyrecon.io.formats.camera_file import read_camera, write_camera
from keyrecon.io.formats.ground_marks import merge_marks
from keyrecon.io.formats.motion_file import read_motion
from keyrecon.io.video import Video
from keyrecon.io.workspace import Workspace
from keyrecon.lens import OPEN_FOCAL, known_focal
from keyrecon.pipeline import Options
from keyrecon.progress import Progress
from keyrecon.records import Motion
from keyrecon.report.court_drawing import draw_grid, write_court_picture
from keyrecon.tracking.camera_motion import estimate_camera_motion
from keyrecon.world.ground_calibration import (
    ContradictoryMarks,
    FieldOfView,
    GroundCalibration,
    calibrate_ground,
    describe_mark,
)
from keyrecon.world.ground_marks import (
    check_field_of_view,
    check_mark,
    mark_names,
    named_marks,
)
from keyrecon.world.records import COURT, KINDS, GroundMark, GroundMarks, Kind

FORMS = {
    "vertical": ("FRAME:X,Y:X,Y or FRAME:X,Y:X,Y:METRES", "0:212,120:214,655:2.44"),
    "length": ("FRAME:X,Y:X,Y:METRES", "0:212,640:655,641:3.66"),
    "horizon": ("FRAME:X,Y:X,Y", "0:20,301:1260,305"),
}
"""How marks are typed, with an example of each."""


def ground_mark(kind: Kind, text: str) -> GroundMark:
    """Parse a mark as it is typed."""
    form, example = FORMS[kind]
    try:
        frame, start, end, *length = (part.strip() for part in text.split(":"))
        (x0, y0), (x1, y1) = ((float(v) for v in place.split(",")) for place in (start, end))
        (metres,) = map(float, length) if length else (None,)
        mark = GroundMark(kind, int(frame), (x0, y0), (x1, y1), metres)
    except ValueError as fault:
        raise KeyreconError(f"--{kind} needs {form}, such as {example}; got '{text}'.") from fault
    if (kind == "length") > (metres is not None) or (kind == "horizon" and metres is not None):
        raise KeyreconError(f"--{kind} needs {form}, such as {example}; got '{text}'.")
    return mark


def find_ground(
    workspace: Workspace,
    new: GroundMarks,
    progress: Progress,
    forget: Sequence[str] = (),
) -> str:
    """Calibrate on all evidence, write camera.npz and ground.jpg; returns the text to show.

    The project keeps the marks, with those of former calls; `forget` names some to be taken out:
    vertical-2, fov, all. Marks that contradict the rest are not kept.
    """
    video = workspace.video()
    before = workspace.ground_marks()
    dropped = named_marks(before, forget)
    kept = merge_marks(before, GroundMarks(), dropped)
    _check_new(new, video)
    together = merge_marks(kept, new)
    _check_no_court(workspace)
    motion = _motion_of(workspace, video)
    options = workspace.options(Options(), Options())
    known = _known_lens(video, together.field_of_view, options.lift.field_of_view)
    path = workspace.stages.keep(
        "camera", estimate_camera_motion, video, options=options.camera, progress=progress
    )
    try:
        found = calibrate_ground(motion, path, (video.width, video.height), together.marks, known)
    except ContradictoryMarks as fault:
        raise KeyreconError(
            f"{_with_names(str(fault), kept)}{_former_input_note(kept, new)}"
        ) from fault
    workspace.change_ground_marks(new, dropped)
    write_camera(workspace.camera_file, found.camera)
    if workspace.ground_marks() != together:
        touch_after(workspace.ground_marks_file, workspace.camera_file)
    picture = workspace.folder / "ground.jpg"
    drawn = draw_grid(video.frame(found.reference), found.camera, found.reference, _height(found))
    write_court_picture(picture, drawn)
    placed = place_stored_motion(workspace)
    return "\n".join(
        [
            *describe_ground(found, together, known),
            *_advice(workspace, found, together, known),
            f"{workspace.camera_file}: the camera of every frame. {picture}: squares of a metre on "
            "the ground, and a post as tall as the player where he first stands; look whether they "
            "lie flat and upright.",
            *_list_marks(together),
            *placed.lines,
            *outdated_report_lines(workspace, placed),
        ]
    )


def _check_new(new: GroundMarks, video: Video) -> None:
    """Raise KeyreconError for marks outside the video, and a field of view that no camera has."""
    for mark in new.marks:
        check_mark(mark, len(video), (video.width, video.height))
    if new.field_of_view is not None:
        check_field_of_view(new.field_of_view)


def _motion_of(workspace: Workspace, video: Video) -> Motion:
    """The project's motion, which must be of the whole video."""
    if not workspace.motion_file.is_file():
        raise KeyreconError(
            "There is no motion yet, and the player is what tells where the ground is: make it "
            f"first with keyrecon run {quoted(workspace.folder)} --height METRES"
        )
    motion = read_motion(workspace.motion_file)
    if len(motion.time) != len(video):
        raise KeyreconError(
            f"The motion has {len(motion.time)} frames and the video {len(video)}; run keyrecon "
            "run again."
        )
    return motion


def _check_no_court(workspace: Workspace) -> None:
    """Raise KeyreconError where a court has told the camera, which it does far better."""
    file = workspace.camera_file
    if file.is_file() and read_camera(file).origin == COURT:
        raise KeyreconError(
            f"{file} has the camera from a court, which tells it more surely than the ground can; "
            "to use the ground all the same, move that file away."
        )


def _known_lens(video: Video, here: float | None, by_run: float | None) -> FieldOfView | None:
    """The lens by the degrees that were given here, else by those of `keyrecon run`, else by the
    file."""
    known = known_focal(video, by_run if here is None else here)
    if known is None or here is not None or by_run is None:
        return known
    return replace(known, source=f"{known.source} that keyrecon run was told")


def _former_input_note(kept: GroundMarks, new: GroundMarks) -> str:
    """What becomes of marks that contradict one another."""
    if not kept.marks:
        return ""
    return (
        f"{' The new marks were not kept.' if new.marks else ''} Marks of former calls: "
        f"{', '.join(mark_names(kept.marks))}; --forget NAME takes one out, --forget all starts "
        "anew."
    )


def _with_names(text: str, kept: GroundMarks) -> str:
    """A message about marks with the names of those that the project has."""
    for name, mark in zip(mark_names(kept.marks), kept.marks, strict=True):
        words = describe_mark(mark).removeprefix("the ")
        text = text.replace(words, f"{words} ({name})")
    return text


def _list_marks(marks: GroundMarks) -> list[str]:
    """What is kept."""
    if not marks.marks:
        return []
    rows = [
        f"{name} (frame {m.frame}, {m.start[0]:g},{m.start[1]:g} to {m.end[0]:g},{m.end[1]:g}"
        f"{'' if m.metres is None else f', {m.metres:g} m'})"
        for name, m in zip(mark_names(marks.marks), marks.marks, strict=True)
    ]
    return [f"Kept marks: {'; '.join(rows)}."]


def _height(found: GroundCalibration) -> float:
    """Of the player, metres."""
    return float(np.exp(found.state.log_size)) * found.stances.stature


def describe_ground(
    found: GroundCalibration, marks: GroundMarks, known: FieldOfView | None
) -> list[str]:
    """Where the camera stands, how it is turned, how surely, and what told so."""
    state, sd = found.state, found.sd
    height, tilt = np.exp(state.log_height), np.degrees(state.tilt)
    near, far = found.distances
    moments = len(found.stances.frame)
    evidence = [f"the player's height where he stands, {counted(moments, 'moment')}"]
    evidence += [
        counted(count, words)
        for kind, words in zip(
            KINDS, ("upright thing", "length on the ground", "horizon"), strict=True
        )
        if (count := sum(mark.kind == kind for mark in marks.marks))
    ]
    evidence += [known.source] if known else []
    return [
        f"The camera is {height:.2f} m high (standard deviation {height * sd.log_height:.2f} m), "
        f"looks {'down' if tilt >= 0 else 'up'} by {abs(tilt):.1f} degrees "
        f"({np.degrees(sd.tilt):.1f}), and is turned by {np.degrees(state.roll):.1f} degrees "
        f"({np.degrees(sd.roll):.1f}); focal length {np.exp(state.log_focal):.0f} px within "
        f"{sd.log_focal:.0%}. The player stands {near:.1f} to {far:.1f} m from it.",
        f"By {', '.join(evidence)}.",
    ]


def _advice(
    workspace: Workspace, found: GroundCalibration, marks: GroundMarks, known: FieldOfView | None
) -> list[str]:
    """What is open, and what would tell it."""
    open_focal = found.sd.log_focal > OPEN_FOCAL
    tilt = float(np.nanmax(found.camera.sd_tilt))
    if not open_focal and tilt <= most_tilt_error(found.camera):
        return []
    near, far = found.distances
    lines = []
    if open_focal:
        focal, factor = np.exp(found.state.log_focal), np.exp(found.sd.log_focal)
        still = " stays on one spot, which" if far < 1.4 * near else "'s ways"
        tells = " tells nothing of it" if far < 1.4 * near else " do not tell more"
        lines.append(
            f"The focal length cannot be told from this ({focal / factor:.0f} to "
            f"{focal * factor:.0f} px): the player{still}{tells}, and distances away from the "
            "camera are as open."
        )
    verticals = sum(mark.kind == "vertical" for mark in marks.marks)
    command = f"keyrecon ground {quoted(workspace.folder)}"
    if verticals < 2:
        help_by = (
            "Mark two upright things, far left and far right in the picture, as long as can be: "
            f"{command} --vertical FRAME:X,Y:X,Y --vertical FRAME:X,Y:X,Y"
        )
    elif known is None:
        help_by = f"Tell the camera's angle across the picture: {command} --fov DEGREES"
    else:
        help_by = f"Mark two points of the horizon: {command} --horizon FRAME:X,Y:X,Y"
    return [*lines, help_by]
