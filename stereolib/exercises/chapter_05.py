"""Exercises on chapter 05: bytes, beams, noise, and what more turns are worth."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.exercises.answers import Array, Number
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tasks import Task, drawn, task

_INVALID, _WEAK, _DISTANCE = 0x80, 0x40, 0x3FFF  # flags in the high byte; the bits of a distance


@task(
    "Read a bias off a figure",
    "read the error of a sensor off a curve",
    minutes=4,
    start="error_pct = None  # the mean error at that distance, in % of the distance",
    hints=(
        "Run `task.picture()` and read the curve at the distance that is asked for.",
        "Divide the error in mm by the distance in mm, and take it times 100. The sign belongs to it.",
    ),
    has_picture=True,
)
def _read_error(rng: np.random.Generator) -> Task:
    at_mm = np.arange(500, 5001, 500)
    errors = np.round(rng.uniform(-3, 3) + at_mm / 1000 * drawn(rng, 4, 9), 1)
    k = int(rng.integers(2, len(at_mm) - 1))

    def draw() -> tuple[Any, str]:
        from stereolib.plotting import panels, plot_curves

        figure, axes = panels(1, width_in=7, aspect=0.6)
        plot_curves({"": (at_mm, errors)}, axes[0], xlabel="distance (mm)", ylabel="mean error (mm)")
        axes[0].set_yticks(np.arange(-4, 51, 2))
        axes[0].set_ylim(min(0.0, errors.min()) - 1, errors.max() + 1)
        return figure, "A rising curve of the mean error of a laser, in millimetres, over distances up to five metres."

    share = 100 * errors[k] / at_mm[k]
    mistakes = {
        "This is the error in mm. Which share of the distance is it?": float(errors[k]),
        "You divided the distance by the error.": float(at_mm[k] / errors[k]),
        "The distance is in mm, and you took it in metres.": float(1000 * share),
    }
    question = (
        f"The picture shows the mean error of a laser (invented for you). **What is it at {at_mm[k]} mm, in % of the "
        "distance?** A reading that is off by half a millimetre is allowed."
    )
    number = Number(float(share), "%", 0.0, mistakes, off=50.0 / float(at_mm[k]) + 1e-9)
    return Task(question, {"distance_mm": int(at_mm[k])}, number, draw)


@task(
    "Two bytes of a packet",
    "read a distance out of the bytes of the sensor",
    minutes=5,
    start="distance_mm = None  # the distance, in mm",
    hints=(
        "The low byte comes first. `int('1f', 16)` turns a byte into a number.",
        "distance = low + 256 high. Here the two highest bits of the high byte are 0.",
    ),
)
def _bytes(rng: np.random.Generator) -> Task:
    distance = int(rng.integers(300, 5000))
    low, high = distance % 256, distance // 256
    mistakes = {
        "The bytes are exchanged: the low one comes first.": 256 * low + high,
        "You added the bytes. The high one counts 256 times.": low + high,
        "The high byte counts 256 times, not 255 times.": low + 255 * high,
        "This is the low byte alone.": low,
        "You read the bytes as decimal digits. They are hexadecimal: 16 to a digit.": low + 100 * high,
    }
    question = (
        f"A packet holds the bytes `{low:02x} {high:02x}` of a distance, with no flags set. "
        "**How many millimetres are they?**"
    )
    return Task(question, {"low": low, "high": high}, Number(float(distance), "mm", 0.0, mistakes, off=0.01))


@task(
    "Where did the beam hit?",
    "turn a reading into a place on the floor",
    minutes=6,
    start="place_mm = None  # (forward, left), in mm",
    hints=(
        "Angles count from straight ahead to the left, seen from above. numpy's functions take radians.",
        "forward = r cos(angle), left = r sin(angle).",
    ),
)
def _place(rng: np.random.Generator) -> Task:
    r_mm, angle_deg = drawn(rng, 500, 3000, 10), drawn(rng, 10, 75) + float(rng.choice([0, 90, 270]))
    angle = np.radians(angle_deg)
    right = r_mm * np.array([np.cos(angle), np.sin(angle)])
    mistakes = {
        "Forward and left are exchanged: forward is the cosine.": right[::-1],
        "You gave degrees to numpy's functions, which take radians.": r_mm
        * np.array([np.cos(angle_deg), np.sin(angle_deg)]),
        "The sign of left is wrong: angles turn to the left.": right * (1, -1),
        "The sign of forward is wrong.": right * (-1, 1),
    }
    question = (
        f"The laser reads {r_mm:g} mm at {angle_deg:g} degrees (0 is straight ahead, turning to the left; its light "
        "starts in the origin). **Where is the point, (forward, left) in mm?**"
    )
    return Task(question, {"r_mm": r_mm, "angle_deg": angle_deg}, Array(right, "mm", 0.004, mistakes))


@task(
    "Noise far away",
    "carry the noise of triangulation to another distance",
    minutes=5,
    start="noise_mm = None  # standard deviation there, in mm",
    hints=(
        "An error on the chip becomes an error of the distance that grows with the square of the distance.",
        "Take the ratio of both distances, square it, and multiply.",
    ),
)
def _noise(rng: np.random.Generator) -> Task:
    near_mm, sigma_mm, ratio = drawn(rng, 500, 1000, 50), drawn(rng, 0.3, 2, 0.1), drawn(rng, 1.5, 4, 0.25)
    mistakes = {
        "You let it grow with the distance. It grows with the square.": sigma_mm * ratio,
        "This is the noise near by: it grows with the distance.": sigma_mm,
        "It grows with the square, not the cube.": sigma_mm * ratio**3,
        "It grows with the distance; yours shrinks.": sigma_mm / ratio**2,
        "You took the root where a square is needed.": sigma_mm * np.sqrt(ratio),
    }
    question = (
        f"A laser that triangulates scatters by {sigma_mm:g} mm (standard deviation) at {near_mm:g} mm. **How much "
        f"does it scatter at {near_mm * ratio:g} mm, in mm?**"
    )
    given = {"near_mm": near_mm, "sigma_mm": sigma_mm, "far_mm": near_mm * ratio}
    return Task(question, given, Number(sigma_mm * ratio**2, "mm", mistakes=mistakes))


@task(
    "How many turns?",
    "choose how many turns to average",
    minutes=6,
    start="turns = None  # the least number of turns",
    hints=(
        "The mean of n independent readings scatters less than one of them by the root of n.",
        "n is the square of the noise of one over the noise that is wanted; round up.",
    ),
)
def _turns(rng: np.random.Generator) -> Task:
    one_mm, wanted_mm = drawn(rng, 3, 9, 0.1), drawn(rng, 1, 2.9, 0.1)
    exact = round((one_mm / wanted_mm) ** 2, 9)  # a whole number stays one
    mistakes = {
        "You forgot the square: the noise falls with the root of n.": float(np.ceil(one_mm / wanted_mm)),
        "You rounded down: with so few the noise is still too large.": float(np.floor(exact)),
        "Turns are whole: round up.": exact,
        "You turned the fraction round.": 1 / exact,
    }
    question = (
        f"One reading of a laser scatters by {one_mm:g} mm, and the readings of different turns are independent. "
        f"**How many turns must be averaged, at least, for a mean that scatters by {wanted_mm:g} mm or less?**"
    )
    given = {"one_mm": one_mm, "wanted_mm": wanted_mm}
    return Task(question, given, Number(float(np.ceil(exact)), "", 0.0, mistakes, off=0.01))


def decoding(*, swapped: bool = False, flagged: float = np.nan, mask: int = _DISTANCE, weak: bool = False) -> Any:
    """Return the decoding of readings of four bytes, or one with a mistake in it; flagged -1: as if it were valid."""

    def distances_mm(data: Any) -> list[float]:
        found = []
        for k in range(0, len(data), 4):
            low, high = (data[k + 1], data[k]) if swapped else data[k : k + 2]
            word = float((low + 256 * high) & mask)
            invalid = bool(data[k + 1] & (_INVALID | (_WEAK if weak else 0)))
            found.append((word if flagged == -1 else flagged) if invalid else word)
        return found

    return distances_mm


@task(
    "Write the decoding yourself",
    "turn a sensor's bytes into distances, and pass over what it marks as invalid",
    minutes=20,
    start=(
        "def distances_mm(data):\n"
        '    """Distances, in mm, of readings of four bytes each; NaN where one is invalid."""\n'
        "    ..."
    ),
    hints=(
        "Take four bytes at a time. The first two are the distance and its flags, the low byte first. Pass over the "
        "other two, the strength of the signal.",
        "Bit 7 of the second byte means invalid (`high & 0x80`). Bit 6 warns of a weak signal, and is no part of the "
        "distance (`high & 0x3F`).",
    ),
    points=3,
)
def _write_decode(rng: np.random.Generator) -> Task:
    def inputs(rng: np.random.Generator) -> tuple[Any, ...]:
        data = b""
        for _ in range(12):
            high = int(rng.integers(0, 24)) | int(rng.choice([0, 0, _INVALID, _WEAK]))
            data += bytes([int(rng.integers(1, 256)), high, *(int(b) for b in rng.integers(0, 256, 2))])
        return (data,)

    answer = Function(
        decoding(),
        inputs,
        rules={"Four bytes make one distance.": lambda out, data: len(out) == len(data) // 4},
        mistakes={
            "The bytes are exchanged: the low one comes first.": decoding(swapped=True),
            "An invalid reading is NaN, not 0.": decoding(flagged=0.0),
            "Invalid readings are returned as distances: look at bit 7 of the second byte.": decoding(flagged=-1),
            "The bit that warns of a weak signal counts as part of the distance.": decoding(mask=0xFFFF),
            "A weak signal is a warning; the distance is still valid.": decoding(weak=True),
        },
    )
    question = (
        "**Write a function `distances_mm(data)`** for the bytes of some readings, four each: two of the distance with "
        "its flags, two of the strength. In the second byte, bit 7 (0x80) says that the reading is invalid, and "
        "bit 6 (0x40) that the signal is weak; the 14 bits below are the distance. Return a list or an array."
    )
    return Task(question, {}, answer)


RECIPES = (_read_error, _bytes, _place, _noise, _turns, _write_decode)
