"""Real clips made harder in ways that are known: what breaks a keyframe project, and is it told.

    python benchmarks/real_variants.py [--variant NAME ...] [--only CLIP ...] [--draws 2]
        [--cost 0.06] [--work DIR] [--sheets]

Clips of `develop`, each changed in one way at a time, encoded anew and taken through the program as
`draws.py --lift` does: bodies marked, keyframes asked for and marked, joints propagated and lifted.
Columns are those of draws.py, mean and worst over the draws. Variants, all from fixed seeds:

    plain     encoded anew, nothing else
    half      half the size, compressed hard
    rate      every other frame
    repeats   every fourth picture in the next one's place too, as conversions of rates do
    dark      a third of the light, and noise
    flat      little contrast, as in fog
    bright    overexposed
    noise     as in a dark hall
    grey      no colours
    lit       the light flickers, and doubles while the clip lasts
    blur      out of focus
    shake     held by hand, up to 13 px at 720 rows, and drifting by 4 % of the width
    zoom      the camera zooms in by a quarter
    crowd     people of other colours sway close beside the player
    framed    black bars, a table of scores and a caption
    rolled    the camera held askew by 4 degrees

At the end the means over the clips. Sheets are of the worst draw of each row.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import real
from changed_clips import CLIP_CHANGES, change_clip
from draws import Draw, describe, draw_once, prepare_clip

from keyrecon.errors import KeyreconError
from keyrecon.io import stages

CLIPS = (
    "tennis_rally",
    "tennis_broadcast_purple",
    "tennis_broadcast_indoor",
    "golf_faceon",
    "golf_dtl_links",
)
"""The short ones of `develop`."""


def show_variant(name: str, variant: str, work: Path) -> real.Clip:
    """A clip as a variant has it."""
    clip = real.load_clip(name)
    file = work / "videos" / f"{name}-{variant}.mp4"
    changed = change_clip(clip, CLIP_CHANGES[variant](clip), file)
    return replace(changed, name=f"{name}-{variant}")


def draw_variant(clip: real.Clip, words: argparse.Namespace) -> list[Draw]:
    """All draws of one clip; its row is printed."""
    try:
        prepared = prepare_clip(clip, words.cost, words.work)
        made = [draw_once(prepared, seed, True) for seed in range(words.draws)]
    except KeyreconError as fault:
        print(f"{clip.name:<34}{fault}", flush=True)
        return []
    print(describe(clip.name, made), flush=True)
    if words.sheets:
        worst = min(made, key=lambda draw: draw.figures["pck"])
        real.write_sheet(clip, worst.marks, worst.joints, words.work / f"{clip.name}.jpg")
    return made


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--variant", nargs="*", choices=CLIP_CHANGES, default=list(CLIP_CHANGES))
    parser.add_argument("--only", nargs="*", choices=real.DEVELOP, default=list(CLIPS))
    parser.add_argument("--draws", type=int, default=2)
    parser.add_argument("--cost", type=float, default=0.06, help="annotation cost asked for")
    parser.add_argument("--work", type=Path, default=Path("benchmarks/work/real_variants"))
    parser.add_argument("--sheets", action="store_true", help="write contact sheets")
    words = parser.parse_args()
    every: dict[str, list[Draw]] = {}
    with patch.object(stages, "KEPT_RESULTS", words.draws + stages.KEPT_RESULTS):
        for variant in words.variant:
            clips = [show_variant(name, variant, words.work) for name in words.only]
            every[variant] = [d for clip in clips for d in draw_variant(clip, words)]
    names = next(iter(draws[0].figures for draws in every.values() if draws), {})
    print("\n" + f"{'mean and worst of':<34}" + "".join(f"{name:>15}" for name in names))
    for variant, made in every.items():
        if made:
            print(describe(f"{variant}, {len(made)} draws", made))


if __name__ == "__main__":
    main()
