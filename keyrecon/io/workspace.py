"""An open project: its video, what a person made in it, its options and the stages' results.

Where each lies in the folder tells `project_folder`.
"""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from keyrecon.errors import KeyreconError, quoted
from keyrecon.io.durable import clear_leftovers, make_folder, write_durably
from keyrecon.io.formats.court_points import (
    merge_clicks,
    read_court_points,
    write_court_points,
)
from keyrecon.io.formats.ground_marks import (
    merge_marks,
    read_ground_marks,
    write_ground_marks,
)
from keyrecon.io.formats.picks import read_picks, write_picks
from keyrecon.io.formats.shot_choices import (
    ShotChoices,
    read_shot_choices,
    write_shot_choices,
)
from keyrecon.io.joined_video import join_videos
from keyrecon.io.option_tables import (
    Record,
    changed_options,
    check_options,
    flat_options,
    nested_tables,
    table_of,
    with_changes,
    with_current_names,
)
from keyrecon.io.project_file import (
    Project,
    new_project,
    no_project,
    read_project,
    with_added_video,
    with_kind,
    with_options,
    with_slow_motion,
    with_video_path,
)
from keyrecon.io.project_folder import GOLF_RESULTS, KEPT, OWN_NAMES, ProjectFolder
from keyrecon.io.project_videos import (
    describe_video,
    open_project_video,
    possible_places,
    relative_path,
    shares_frames,
    which_videos,
)
from keyrecon.io.stages import StageStore
from keyrecon.io.video import Video, open_video
from keyrecon.io.workers import Workers
from keyrecon.reading import read_text
from keyrecon.records import Pick
from keyrecon.world.records import CourtClick, GroundMarks

GOLF = "golf"
"""The kind of project that a golf swing is, and the section of its options."""
COURT = "court"
"""The section of the options of `keyrecon court`."""
SECTIONS = (GOLF, COURT)
"""Tables of options beside those of the pipeline."""


class Workspace(ProjectFolder):
    """A project that is there."""

    def __init__(self, folder: Path, force: bool = False, workers: Workers | None = None) -> None:
        """Open the project in `folder`; `force` makes every stage again, `workers` make them.

        These need the whole path of the folder.
        """
        super().__init__(folder if workers is None else folder.absolute())
        self.stages = StageStore(self.folder / "cache", force, workers)
        if not self.project_file.is_file():
            raise no_project(folder)
        self.project = read_project(self.project_file)
        for place in (folder, self.stages.folder, self.pictures):
            clear_leftovers(place)

    @property
    def is_golf(self) -> bool:
        """Whether the project is one of a golf swing: begun or become one, or with its clicks."""
        kind = read_project(self.project_file).get("kind")
        return kind == GOLF or self.golf_clicks_file.is_file()

    def become_golf(self) -> None:
        """Make the project one of a golf swing, besides what it is."""
        if self.project.get("kind") != GOLF:
            with self.exclusive():
                write_durably(self.project_file, with_kind(self.project_file, GOLF))
            self.project = read_project(self.project_file)

    def golf_results(self) -> list[Path]:
        """Files besides motion and report that a golf fit wrote."""
        files = (self.folder / name for name in GOLF_RESULTS)
        return [file for file in files if self.is_golf and file.is_file()]

    @classmethod
    def create(
        cls, folder: Path, video: Video, video_file: Path, trim: dict, kind: str | None = None
    ) -> "Workspace":
        """Start a project; never touches one that exists."""
        file = folder / "project.toml"
        if file.exists():
            raise KeyreconError(f"{file} exists already; choose another folder for a new project.")
        text = new_project(file, describe_video(video, video_file, folder, trim), kind)
        make_folder(folder)
        write_durably(file, text)
        return cls(folder)

    @property
    def videos(self) -> list[dict]:
        """What project.toml tells of each video."""
        return [self.project["video"], *self.project.get("added", [])]

    def video(self) -> Video:
        """The project's video, of all its files; looks beside the project for one that has moved.

        Raises KeyreconError where one is gone, or has changed since.
        """
        return open_project_video(self.folder, self.videos)

    def add_video(self, file: Path, trim: dict) -> Video:
        """Go on with another file behind those that are there; returns all together.

        Raises KeyreconError, and changes nothing, where it does not fit to them.
        """
        alone = open_video(
            file, trim.get("start", 0), trim.get("end"), trim.get("slow_motion", 1.0)
        )
        table = describe_video(alone, file, self.folder, trim)
        if any(shares_frames(table, present) for present in self.videos):
            raise KeyreconError(f"Frames of {file} are in the project already.")
        together = join_videos([self.video(), alone])
        with self.exclusive():
            write_durably(self.project_file, with_added_video(self.project_file, table))
        self.project = read_project(self.project_file)
        return together

    def set_slow_motion(self, factor: float) -> None:
        """Keep how many times slower than life the video plays; its times stay as they are."""
        with self.exclusive():
            write_durably(self.project_file, with_slow_motion(self.project_file, factor))
        self.project = read_project(self.project_file)

    def relink(self, video_file: Path) -> None:
        """Point the project at the place that a video of it has moved to, with all its parts."""
        numbers = which_videos(self.videos, video_file)
        with self.exclusive():
            place = relative_path(video_file, self.folder)
            write_durably(self.project_file, with_video_path(self.project_file, place, numbers))
        self.project = read_project(self.project_file)

    def picks(self) -> tuple[Pick, ...]:
        """What a person clicked, in a fixed order, so that stage results do not depend on it.

        Raises KeyreconError when there is nothing yet.
        """
        if not self.picks_file.is_file():
            folder = quoted(self.folder)
            raise KeyreconError(
                f"{self.folder} has no picks yet, and no marked body; click the player's head, "
                f"feet and clothes on the page of keyrecon annotate {folder}, or with: keyrecon "
                f"pick {folder} --frame N --head X,Y --foot X,Y --foot X,Y --region shirt:X,Y; or "
                f"mark the joints of one whole body and import them: keyrecon import {folder} FILE"
            )
        picks = read_picks(self.picks_file)
        return tuple(sorted(picks, key=lambda p: (p.frame, p.part, p.x, p.y)))

    def add_picks(self, picks: Sequence[Pick]) -> tuple[Pick, ...]:
        """Add clicks to those there are."""
        with self.exclusive():
            old = self.picks() if self.picks_file.is_file() else ()
            together = tuple(dict.fromkeys((*old, *picks)))
            write_picks(self.picks_file, together)
        return together

    def shot_choices(self) -> ShotChoices:
        """What a person said of shots since the last run."""
        file = self.shots_file
        return read_shot_choices(file) if file.is_file() else ShotChoices()

    def choose_shot(self, number: int, used: bool | None) -> None:
        """Keep what a person says of a shot; None takes back what was said."""
        with self.exclusive():
            write_shot_choices(self.shots_file, self.shot_choices().with_choice(number, used))

    def forget_shot_choices(self, taken: ShotChoices) -> None:
        """Drop choices that the project's options have taken over; later ones stay."""
        with self.exclusive():
            if self.shot_choices() == taken:
                self.shots_file.unlink(missing_ok=True)

    def court_clicks(self) -> tuple[CourtClick, ...]:
        """Points of the court that a person clicked, in one order."""
        file = self.court_points_file
        return read_court_points(file) if file.is_file() else ()

    def change_court_clicks(
        self, added: Sequence[CourtClick] = (), dropped: Sequence[CourtClick] = ()
    ) -> None:
        """Keep clicks on the court; one of the same point in the same frame is replaced."""
        with self.exclusive():
            old = self.court_clicks()
            new = merge_clicks([click for click in old if click not in dropped], added)
            if new != old:
                write_court_points(self.court_points_file, new)

    def ground_marks(self) -> GroundMarks:
        """What a person told of the ground and the camera."""
        file = self.ground_marks_file
        return read_ground_marks(file) if file.is_file() else GroundMarks()

    def change_ground_marks(
        self, added: GroundMarks = GroundMarks(), dropped: GroundMarks = GroundMarks()
    ) -> None:
        """Keep what a person told of the ground, and drop what was taken back."""
        with self.exclusive():
            old = self.ground_marks()
            if (new := merge_marks(old, added, dropped)) != old:
                write_ground_marks(self.ground_marks_file, new)

    def kept_files(self) -> list[Path]:
        """Files of `KEPT`, and the videos."""
        files = [file for name in KEPT for file in self.folder.glob(name)]
        places = possible_places(self.folder, self.videos)
        return [file for file in (*files, *places) if file.is_file()]

    def reserves(self, file: Path) -> bool:
        """Whether a file's place is one of the project's own, whether there is a file or not."""
        inside = file.parent.exists() and file.parent.samefile(self.folder)
        videos = [(self.folder / table["path"]).resolve() for table in self.videos]
        own = (*OWN_NAMES, *(GOLF_RESULTS if self.is_golf else ()))
        return (inside and file.name.lower() in own) or file.resolve() in videos

    def is_kept(self, file: Path) -> bool:
        """Whether a file is one of `kept_files`."""
        return file.exists() and any(kept.samefile(file) for kept in self.kept_files())

    def options(
        self,
        given: Record,
        defaults: Record,
        section: str | None = None,
        typed: Collection[str] = (),
    ) -> Record:
        """Options that this project has set, and on top of them what `given` sets otherwise.

        `section` names a table of SECTIONS. `typed` are dotted names of options that were given on
        the command line: they count also where their value is the default.
        """
        check_options(given)
        table = with_current_names(self.project.get("options", {}))
        where = f"options.{section}" if section else "options"
        kept = with_changes(defaults, table_of(table, section, SECTIONS), where)
        return with_changes(kept, nested_tables(changed_options(given, defaults, typed=typed)))

    def remember(self, options: Record, defaults: Record, section: str | None = None) -> None:
        """Keep what the options change of those that the project was opened with, the defaults left
        out; what else the file holds by now stays.

        Raises KeyreconError, and writes nothing, for values that an option cannot have.
        """
        check_options(options)
        prefix = f"{section}." if section else ""
        opened_with = self.options(defaults, defaults, section)
        before, wanted = (
            {name: v for name, v in changed_options(one, defaults, prefix).items() if v is not None}
            for one in (opened_with, options)
        )
        changed = {n: v for n, v in wanted.items() if n not in before or before[n] != v}

        def with_own(project: Project) -> dict[str, Any]:
            kept = flat_options(with_current_names(project.get("options", {})))
            return {n: v for n, v in kept.items() if n in wanted or n not in before} | changed

        with self.exclusive():
            text = with_options(self.project_file, with_own(read_project(self.project_file)))
            if text != read_text(self.project_file):
                write_durably(self.project_file, text)
        # not as the file is by now: what others wrote into it would be taken back the next time
        self.project = {**self.project, "options": nested_tables(with_own(self.project))}

    @contextmanager
    def remembering(
        self, options: Record, defaults: Record, section: str | None = None
    ) -> Iterator[None]:
        """Keep options, as `remember` does, from the beginning of the work that they are for.

        Whoever interrupts it goes on with them; where it is refused, the file is as it was before,
        but for what others wrote into it meanwhile.
        """
        file, opened = self.project_file, self.project
        content, before = file.read_bytes(), _options_in(file)
        self.remember(options, defaults, section)
        kept, mine = file.read_bytes(), _options_in(file)
        try:
            yield
        except KeyreconError:
            changed = {n for n in before | mine if before.get(n) != mine.get(n)}
            with self.exclusive():
                now = {n: v for n, v in _options_in(file).items() if n not in changed}
                restored = now | {n: before[n] for n in changed if n in before}
                alone = file.read_bytes() == kept
                write_durably(file, content if alone else with_options(file, restored))
            self.project = opened
            raise


def _options_in(file: Path) -> dict[str, Any]:
    """Options that a project file has, by dotted names."""
    return flat_options(with_current_names(read_project(file).get("options", {})))
