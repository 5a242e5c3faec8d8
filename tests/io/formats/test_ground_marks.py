"""What was told of the ground is read as it was written."""

import json

import pytest

from keyrecon.errors import KeyreconError
from keyrecon.io.formats.ground_marks import read_ground_marks, write_ground_marks
from keyrecon.world.records import GroundMark, GroundMarks


def test_marks_come_back_as_they_were(tmp_path):
    told = GroundMarks(
        (
            GroundMark("vertical", 3, (1.5, 2.25), (1.0, 90.0)),
            GroundMark("length", 0, (1.5, 2.25), (1.0, 90.0), 2.44),
            GroundMark("horizon", 12, (0.0, 30.0), (99.0, 31.0)),
        ),
        62.5,
    )
    for marks in (told, GroundMarks()):
        write_ground_marks(tmp_path / "m.json", marks)
        assert read_ground_marks(tmp_path / "m.json") == marks


def test_a_kind_that_nobody_knows_is_refused(tmp_path):
    row = {"kind": "slope", "frame": 0, "ends": [[0, 0], [9, 9]], "metres": None}
    (tmp_path / "m.json").write_text(json.dumps({"field_of_view": None, "marks": [row]}))
    with pytest.raises(KeyreconError, match="'slope' is no kind of mark"):
        read_ground_marks(tmp_path / "m.json")
