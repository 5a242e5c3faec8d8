"""Depth and side models that have not seen the players of a sequence.

The models that come with keyrecon are learnt from all captures at hand, those of the rendered
sequences among them. Measured with them, a sequence would be one that they know. So every sequence
is reconstructed with models learnt from all captures but those of its own players.
"""

import hashlib
import sys
from pathlib import Path

from sequences import OTHER, TENNIS, Sequence, mocap_files

from keyrecon.app.console import show
from keyrecon.app.depth_training import learn_from_files
from keyrecon.app.side_training import learn_from_files as learn_sides
from keyrecon.body_models.depth_model import DepthModel
from keyrecon.body_models.depth_training import DepthTrainingOptions
from keyrecon.body_models.side_training import SideTrainingOptions
from keyrecon.errors import KeyreconError
from keyrecon.io.formats.mocap import find_captures, read_capture
from keyrecon.io.formats.model_file import (
    read_depth_model,
    write_depth_model,
    write_side_model,
)


def unseen_model(sequence: Sequence, work: Path, mocap: Path) -> tuple[Path, DepthModel]:
    """A depth model learnt without the players of a sequence, and its file in the work folder."""
    path, others = _file_and_captures("depths", DepthTrainingOptions(), sequence, work, mocap)
    if not path.is_file():
        write_depth_model(path, learn_from_files(others, progress=show))
    return path, read_depth_model(path)


def unseen_sides(sequence: Sequence, work: Path, mocap: Path) -> Path:
    """The file of a side model learnt likewise."""
    path, others = _file_and_captures("sides", SideTrainingOptions(), sequence, work, mocap)
    if not path.is_file():
        write_side_model(path, learn_sides(others, progress=show))
    return path


def _file_and_captures(
    kind: str, options: object, sequence: Sequence, work: Path, mocap: Path
) -> tuple[Path, list[Path]]:
    """Where a model without the players of a sequence is kept, and what it is learnt from.

    One model serves all sequences of the first table, and has seen none of their players; so it is
    with motion that is no tennis.
    """
    table = next((t for t in (TENNIS, OTHER) if sequence in t), (sequence,))
    players = {player(file) for member in table for file in mocap_files(member, mocap)}
    _, others = captures_without(players, mocap)
    made_of = repr((options, [file.name for file in others]))
    tag = hashlib.sha256(made_of.encode()).hexdigest()[:8]
    return work / f"{kind}-without-{'-'.join(sorted(players))}-{tag}.npz", others


def captures_without(players: set[str], mocap: Path) -> tuple[list[Path], list[Path]]:
    """Readable captures of these players, and all others."""
    folders = sorted(folder for folder in mocap.iterdir() if folder.is_dir())
    files = [file for file in find_captures(folders) if readable(file)]
    theirs = [file for file in files if player(file) in players]
    return theirs, [file for file in files if file not in theirs]


def readable(file: Path) -> bool:
    """Whether a capture can be read; what cannot is told and left out."""
    try:
        read_capture(file)
    except KeyreconError as fault:
        print(f"left out: {fault}", file=sys.stderr)
        return False
    return True


def player(file: Path) -> str:
    """Who was captured: cmu_05_12_daz is subject 05 of CMU, jarua_Reves is jarua."""
    words = file.stem.split("_")
    return "_".join(words[:2]) if words[0] == "cmu" else words[0]
