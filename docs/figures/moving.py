"""Makes the moving pictures of docs/gallery.md, docs/figures/moving-NAME.gif: films of its commands, made smaller.

`make figures` runs it; it takes two minutes. Together they are below 15 MB.
"""

import tempfile
from pathlib import Path

from PIL import Image
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.overhead.film import open_film

FOLDER = Path(__file__).parent
WIDTH, FRAME_MS, COLOURS = 260, 80, 40  # width in pixels, time for which a picture is shown, and its colours

LIT = "--set light=lit"
FILMS = {
    "thesis": f"run thesis --seed 107 --set max_time_s=12 {LIT}",
    "dark": "run thesis --seed 107 --set max_time_s=12",
    "obstacles": f"run obstacles --seed 1 --set max_time_s=12 {LIT}",
    "crowded": f"run crowded --seed 1 --set max_time_s=12 {LIT}",
    "pair": f"run pair --seed 1 --set max_time_s=12 {LIT}",
    "pushing": f"run pushing --seed 1 --set max_time_s=12 {LIT}",
    "kilobots": f"run kilobots --seed 1 --set max_time_s=12 {LIT}",
    "particles": "run particles --seed 2 --set max_cycles=12",
    "neighbours": "run particles --seed 2 --set k=3 --set max_cycles=12",
    "segment": "run particles --seed 2 --set dimensions=1 --set max_cycles=12",
}
"""Commands that film a trial, without `--film FILE.mp4`."""


def main() -> None:
    """Film each and write it as a GIF."""
    for name, command in FILMS.items():
        with tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / "t.mp4"
            done = CliRunner().invoke(app, [*command.split(), "--film", str(film)])
            assert done.exit_code == 0, done.stderr
            with open_film(str(film)) as frames:
                pictures: list[Image.Image] = []
                for frame in frames.frames():
                    if 1000 * frame.time_s >= FRAME_MS * len(pictures) - 1:
                        pictures.append(Image.fromarray(frame.picture))
        height = round(WIDTH * pictures[0].height / pictures[0].width)
        small = [picture.resize((WIDTH, height), Image.Resampling.LANCZOS) for picture in pictures]
        palette = small[len(small) // 2].quantize(COLOURS)  # one for all, or colours would flicker
        shown = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in small]
        first, *others = shown
        out = FOLDER / f"moving-{name}.gif"
        first.save(out, save_all=True, append_images=others, duration=FRAME_MS, loop=0, optimize=True)
        print(out, f"{out.stat().st_size / 1e6:.2f} MB", flush=True)


if __name__ == "__main__":
    main()
