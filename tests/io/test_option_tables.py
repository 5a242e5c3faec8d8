"""Every option has a range that holds what is usual and keeps out what cannot be."""

from dataclasses import fields

import pytest

from keyrecon import KeyreconError
from keyrecon.body_models.depth_training import DepthTrainingOptions
from keyrecon.golf.prior.training import TrainOptions
from keyrecon.golf.swing_fit import GolfOptions
from keyrecon.io.option_tables import OptionRecord, changed_options, check_options, with_changes
from keyrecon.pipeline import Options, as_printed
from keyrecon.synthetic.sequence import SynthOptions
from keyrecon.world.calibration import CalibrationOptions

RECORDS = (
    *(Options(), GolfOptions(), TrainOptions(), SynthOptions(), DepthTrainingOptions()),
    CalibrationOptions(),
)


def numbers(options, prefix=""):
    """Dotted names and values of all options that are numbers, or None in their place."""
    for field in fields(options):
        value = getattr(options, field.name)
        if isinstance(value, OptionRecord):
            yield from numbers(value, f"{prefix}{field.name}.")
        elif isinstance(value, int | float | None) and not isinstance(value, bool):
            yield f"{prefix}{field.name}", value


CASES = [(o, name, value) for o in RECORDS for name, value in numbers(o)]


@pytest.mark.parametrize("options", [*RECORDS, as_printed(Options())])
def test_the_defaults_and_the_printed_forms_lie_within(options):
    check_options(options)
    assert changed_options(options, options) == {}


def tables(name, value):
    for part in reversed(name.split(".")):
        value = {part: value}
    return value


def test_every_number_has_a_range_and_what_lies_outside_is_refused_in_one_line():
    assert len(CASES) > 200
    for options, name, _ in CASES:
        for absurd in (-1e9, 1e12, float("nan"), float("inf"), 10**400, "x", [1.0], True):
            with pytest.raises(KeyreconError, match=rf"{name} cannot be") as told:
                with_changes(options, tables(name, absurd))
            assert "\n" not in str(told.value)
            assert len(str(told.value)) < 600


def test_half_and_twice_of_every_default_can_be_tried():
    for options, name, value in CASES:
        share = isinstance(value, float) and 0.5 < value <= 1
        if not value or share or "stature" in name:  # there is no person of 3.5 metres
            continue
        for factor in (0.5, 2):
            tried = max(1, round(value * factor)) if isinstance(value, int) else value * factor
            with_changes(options, tables(name, tried))
