"""Snapshots after each other, on the same scales."""
import io
import shutil
import subprocess

from PIL import Image

from .drawing import FigureError
from .maps import Maps
from .style import plt

DPI = 110


def _frame(maps, number, entry):
    """One row of maps as an RGB image."""
    figure = maps.row(number).draw(entry)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI)
    plt.close(figure)
    return Image.open(buffer).convert("RGB")


def animate(study, entry, style, path, seconds):
    """Writes all snapshots of the first run, and those of the others nearest in time, as GIF or, with ffmpeg, MP4 of so many seconds."""
    first = next(run for run in study.runs if run.result is not None)
    times = [float(snapshot.time) for snapshot in first.result.snapshots]
    if len(times) < 2:
        raise FigureError(f"{first.result.path}: one snapshot does not move ([output] snapshots)")
    maps = Maps.of(study, {**entry, "snapshot": times}, style, [])
    frames = [_frame(maps, k, entry) for k in range(len(times))]
    if path.suffix == ".gif":
        palette = frames[-1].quantize(96)
        paletted = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        paletted[0].save(path, save_all=True, append_images=paletted[1:], duration=max(20, round(1000 * seconds / len(frames))), loop=0, optimize=True)
        return
    if not shutil.which("ffmpeg"):
        raise FigureError("an MP4 needs ffmpeg (package ffmpeg); a GIF needs nothing more")
    width, height = (size - size % 2 for size in frames[0].size)
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{len(frames) / seconds:.3f}",
               "-i", "-", "-pix_fmt", "yuv420p", "-crf", "18", str(path)]
    done = subprocess.run(command, input=b"".join(frame.crop((0, 0, width, height)).tobytes() for frame in frames), capture_output=True)
    if done.returncode:
        raise FigureError(f"ffmpeg: {done.stderr.decode(errors='replace').strip()}")
