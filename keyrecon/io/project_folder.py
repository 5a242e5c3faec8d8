"""Where everything lies in a project folder: the only place that knows file names.

    project.toml       the video (relative path, fingerprint, trim) and options that were set
    picks.json         colours that a person clicked
    keyframes.json     frames to annotate, with a picture of each in keyframes/
    annotations.json   what a person marked
    skeleton.json      joints and bones, where they are not the default ones
    golf_clicks.json   of a golf swing: six joints of the address
    golf_marks.json    of a golf swing: what a person put right in a fit
    court_points.json  points of the court that a person clicked
    shots.json         shots that a person said to use or to leave out, until the next run
    ground_marks.json  upright things, lengths and the horizon that a person marked
    camera.npz         the camera of every frame, where a court or the ground has told it
    motion.npz, report.html
    exports/           files for other programs that the page wrote
    cache/             results of the stages; safe to delete

What a person made is written durably and never replaced by something that does not parse.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from keyrecon.body import LSP14, Skeleton, read_skeleton
from keyrecon.io.durable import hold_lock

OWN_NAMES = (
    *("project.toml", "picks.json", "keyframes.json", "annotations.json", "skeleton.json"),
    *("annotate.sqlite", "motion.npz", "report.html", "golf_clicks.json", "golf_marks.json"),
    *("camera.npz", "court_points.json", "ground_marks.json", "shots.json"),
)
"""Files that a project has or may come to have."""
KEPT = ("*.toml", "*.json", "*.sqlite*", "motion.npz", "report.html")
"""Files there are that hold a person's work, or from which the rest is made."""
GOLF_RESULTS = ("golf.csv", "overlay.mp4")
"""Files besides motion and report that a golf fit writes, and takes for its own."""


class ProjectFolder:
    """A folder with the files of one project."""

    def __init__(self, folder: Path) -> None:
        """A folder that need not have them yet."""
        self.folder = folder

    @property
    def project_file(self) -> Path:
        """project.toml"""
        return self.folder / "project.toml"

    @property
    def picks_file(self) -> Path:
        """picks.json"""
        return self.folder / "picks.json"

    @property
    def keyframes_file(self) -> Path:
        """keyframes.json"""
        return self.folder / "keyframes.json"

    @property
    def annotations_file(self) -> Path:
        """annotations.json"""
        return self.folder / "annotations.json"

    @property
    def prepared_marks_file(self) -> Path:
        """Marks that the automatic part was last made with; none where picks were enough."""
        return self.folder / "cache" / "prepared_marks.json"

    @property
    def prepared_picks_file(self) -> Path:
        """Picks that the automatic part was last made with: those left aside are not among them."""
        return self.folder / "cache" / "prepared_picks.json"

    @property
    def motion_file(self) -> Path:
        """motion.npz"""
        return self.folder / "motion.npz"

    @property
    def camera_file(self) -> Path:
        """camera.npz"""
        return self.folder / "camera.npz"

    @property
    def court_points_file(self) -> Path:
        """court_points.json"""
        return self.folder / "court_points.json"

    @property
    def report_file(self) -> Path:
        """report.html"""
        return self.folder / "report.html"

    @property
    def golf_clicks_file(self) -> Path:
        """golf_clicks.json"""
        return self.folder / "golf_clicks.json"

    @property
    def golf_marks_file(self) -> Path:
        """golf_marks.json"""
        return self.folder / "golf_marks.json"

    @property
    def shots_file(self) -> Path:
        """shots.json"""
        return self.folder / "shots.json"

    @property
    def ground_marks_file(self) -> Path:
        """ground_marks.json"""
        return self.folder / "ground_marks.json"

    @property
    def exports(self) -> Path:
        """Folder for files that the page writes for other programs."""
        return self.folder / "exports"

    def exported_files(self) -> list[Path]:
        """What stands in that folder."""
        files = self.exports.iterdir() if self.exports.is_dir() else ()
        return sorted(f for f in files if f.is_file() and not f.name.startswith("."))

    @property
    def skeleton(self) -> Skeleton:
        """The joints to mark: those of skeleton.json where the project has one."""
        file = self.folder / "skeleton.json"
        return read_skeleton(file) if file.is_file() else LSP14

    @property
    def pictures(self) -> Path:
        """Folder with a picture of every keyframe to annotate."""
        return self.folder / "keyframes"

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Hold the project's files that a person made while they are read and replaced.

        Commands and the annotator may change one project at the same time; each sees the
        other's marks whole.
        """
        lock = hold_lock(self.folder / ".change.lock")
        try:
            yield
        finally:
            lock.release()

    def check_writable(self) -> None:
        """Raise KeyreconError where the project takes no files."""
        with self.exclusive():
            pass


def another_projects_file(file: Path) -> bool:
    """Whether a file's place is one of those that the project in its folder needs."""
    if not (file.parent / "project.toml").is_file():
        return False
    kept = file.exists() and any(file.match(name) for name in KEPT)
    return kept or file.name.lower() in OWN_NAMES
