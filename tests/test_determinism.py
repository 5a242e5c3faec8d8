"""Identical input gives identical bits, however many cores there are and wherever arrays lie."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from drawn_player import film

from keyrecon.tracking.radial_symmetry import gradient_field

SCRIPT = """
import hashlib, sys
from dataclasses import fields, is_dataclass
from pathlib import Path
import numpy as np
from drawn_player import picks
from keyrecon.io.video import open_video
from keyrecon.pipeline import Options, prepare
from keyrecon.keyframes.selection import KeyframeOptions

digest = hashlib.sha256()

def feed(value):
    if isinstance(value, np.ndarray):
        digest.update(value.tobytes())
    elif isinstance(value, tuple):
        [feed(part) for part in value]
    elif is_dataclass(value):
        [feed(getattr(value, field.name)) for field in fields(value) if field.name != "video"]

options = Options(keyframes=KeyframeOptions(budget=0.1))
feed(prepare(open_video(Path(sys.argv[1])), picks(24, True), options))
print(digest.hexdigest())
"""


def prepared_digest(video: Path, cores: set[int]) -> str:
    """Digest of all that the automatic part makes of a drawn player, on some cores."""
    paths = os.pathsep.join(path for path in sys.path if path)
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(video)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": paths},
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    return ran.stdout


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here")
def test_one_core_and_all_cores_give_the_same_bits_and_so_does_a_second_time(tmp_path):
    cores = os.sched_getaffinity(0)
    video = film(tmp_path / "player.mp4", 24, True).path
    one = prepared_digest(video, {min(cores)})
    assert prepared_digest(video, cores) == one
    assert prepared_digest(video, cores) == one


def test_gradients_do_not_depend_on_where_their_picture_lies_in_memory():
    picture = np.random.default_rng(0).random((61, 67)).astype(np.float32)
    first = gradient_field(picture)
    for shift in range(1, 16):
        room = np.empty(picture.size + 16, np.float32)
        moved = room[shift : shift + picture.size].reshape(picture.shape)
        moved[:] = picture
        again = gradient_field(moved)
        np.testing.assert_array_equal(again.gx, first.gx)
        np.testing.assert_array_equal(again.x, first.x)
