"""Virtual pairs unlike those of the rig: layers in disparity, as varied as photographs are.

A layer is a surface ``d(x, y)`` of the left picture with an outline and a texture; the nearest one is seen, and each
side is sampled twice as finely as its pixels. `TRAINING` and `TEST` share no texture and no shape: the first has
textures made of noise on planes and domes behind polygons, the second photographs on waves and planes behind discs and
rings, and other sizes, slants and blur. Each has three kinds: webcams in rooms, small crowded pictures, sharp ones with
hardly any noise. Those of the other sets are kinds of `TRAINING`, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import skimage.data
from joblib import Parallel, delayed
from virtual_pairs import Pair

Array = np.ndarray
_FINER = 2  # samples a pixel, each way
_SWEEPS = 12  # fixed-point steps from a column of the right picture to its surface's in the left one


@dataclass(frozen=True)
class Look:
    """What the scenes of one set are drawn from; pairs are lowest and highest.

    `noise`: deviation in grey levels; `gain` of the right picture; `rows_px`: offset and roll at the rim; `shade`: how
    much a surface's brightness differs between the cameras; `blur_px`: of the lens; `relief_px`: how far each of the
    waves of a surface may rise and fall; `gloss`: the most that a soft light lies on one picture alone, share of its
    grey; `shining`: share of the surfaces in which a lamp is mirrored.
    """

    size: tuple[int, int]
    far_px: tuple[float, float]
    near_px: tuple[float, float]
    objects: tuple[int, int]
    rods: tuple[int, int]
    rod_px: tuple[float, float]
    slant: float
    noise: tuple[float, ...]
    gain: tuple[float, ...]
    rows_px: tuple[float, ...]
    shade: float
    blur_px: tuple[float, ...]
    textures: str
    shapes: str
    relief_px: float = 0.0
    gloss: float = 0.0
    shining: float = 0.0


TRAINING = Look((640, 440), (4, 16), (24, 80), (5, 11), (0, 5), (1.5, 5.0), 0.10, (0.7, 1.5, 3.0, 6.0),
                (1.0, 1.0, 0.9), (0.0, 0.0, 0.2), 0.04, (0.5, 0.9), "noise", "polygons")  # fmt: skip
TEST = Look((720, 480), (6, 24), (30, 100), (4, 9), (1, 4), (2.0, 6.0), 0.15, (0.5, 1.0, 2.0, 4.5),
            (1.0, 1.0, 0.95), (0.0, 0.0, 0.15), 0.03, (0.4, 0.7), "photographs", "discs")  # fmt: skip
#: Small bright pictures crowded with things, as those that are published with a measured truth often are.
TRAINING_CROWDED = replace(TRAINING, size=(450, 376), near_px=(18, 60), objects=(14, 26), rods=(1, 6),
                           noise=(0.4, 0.8, 1.2), gain=(1.0,), rows_px=(0.0, 0.1), blur_px=(0.4, 0.6))  # fmt: skip
TEST_CROWDED = replace(TEST, size=(500, 400), near_px=(20, 70), objects=(12, 20), rods=(2, 7), noise=(0.3, 0.6, 1.0),
                       gain=(1.0,), rows_px=(0.0, 0.08), blur_px=(0.45, 0.55))  # fmt: skip
#: What a good camera sees in a full room, pictures of twelve million pixels made small: hardly any noise, sharp, detail
#: down to the pixel nearly everywhere, materials that change where the surface does not, relief, wires, soft gloss.
TRAINING_SHARP = replace(TRAINING, size=(500, 220), far_px=(8, 20), near_px=(25, 56), objects=(6, 12), rods=(2, 7),
                         rod_px=(1.0, 4.0), slant=0.2, noise=(0.3, 0.6, 1.0), gain=(1.0, 1.0, 0.97),
                         rows_px=(0.0, 0.1), shade=0.02, blur_px=(0.35, 0.5), textures="materials", relief_px=0.8,
                         gloss=0.1)  # fmt: skip
TEST_SHARP = replace(TEST, size=(540, 240), far_px=(10, 24), near_px=(28, 64), objects=(5, 10), rods=(2, 6),
                     rod_px=(1.2, 5.0), slant=0.25, noise=(0.4, 0.8), gain=(1.0, 0.98), rows_px=(0.0, 0.08),
                     shade=0.025, blur_px=(0.4, 0.45), textures="fine photographs", relief_px=1.0,
                     gloss=0.08)  # fmt: skip
#: Materials again, slanted more, in any noise: large parts of one colour beside edges, among which are those of depth.
#: Added after the test pairs had shown that a choice without it does not carry over to such parts.
TRAINING_MATERIALS = replace(TRAINING, slant=0.2, textures="materials")
#: Glossy things under a lamp: on them the deviations are found, too.
TRAINING_SHINING = replace(TRAINING, noise=(0.5, 1.0, 2.0), shining=0.6)
#: Two kinds that were added after real pairs had shown what the others lack. Surfaces that rise and fall within tens
#: of pixels, as those of leaves and cloth do.
TRAINING_RELIEF = replace(TRAINING_CROWDED, objects=(6, 14), textures="materials", relief_px=2.0)
#: Things of the colours of what is behind them, as leaves before patterned cloth.
TRAINING_ALIKE = replace(TRAINING_CROWDED, objects=(6, 14), textures="shared materials")
SETS = {"training": ((TRAINING, range(100, 116)), (TRAINING_CROWDED, range(120, 128)),
                     (TRAINING_SHARP, range(140, 150)), (TRAINING_MATERIALS, range(170, 182))),
        "shining": ((TRAINING_SHINING, range(160, 172)),),
        "hard": ((TRAINING_RELIEF, range(190, 200)), (TRAINING_ALIKE, range(300, 310))),
        "test": ((TEST, range(200, 212)), (TEST_CROWDED, range(220, 228)),
                 (TEST_SHARP, range(240, 248)))}  # fmt: skip


def layered_set(name: str) -> list[Pair]:
    """All pairs of a set."""
    return Parallel(n_jobs=2)(delayed(layered)(look, seed) for look, seeds in SETS[name] for seed in seeds)


@dataclass(frozen=True, eq=False)
class Lamp:
    """What a surface mirrors of it: place in the left picture, half widths, grey levels; its own disparity, px.

    The mirrored lamp stands behind a flat surface or in front of a hollow one: both cameras see it elsewhere on it.
    """

    at: Array
    half_px: Array
    grey: float
    disparity_px: float

    def light(self, x: Array, y: Array, right: bool) -> Array:
        """Grey levels that it adds at columns and rows of a picture, with the long tails of rough surfaces."""
        off = (x + right * self.disparity_px - self.at[0]) / self.half_px[0], (y - self.at[1]) / self.half_px[1]
        return self.grey / (1 + off[0] ** 2 + off[1] ** 2) ** 2


@dataclass(frozen=True, eq=False)
class Layer:
    """A surface: its disparity and whether it is there, of columns and rows of the left picture; its texture."""

    disparity: Callable[[Array, Array], Array]
    inside: Callable[[Array, Array], Array]
    texture: Array
    to_texture: Array
    lamp: Lamp | None = None

    def color(self, x: Array, y: Array) -> Array:
        """Its colour, (H, W, 3), at columns and rows of the left picture."""
        u, v = (self.to_texture[i, 0] * x + self.to_texture[i, 1] * y + self.to_texture[i, 2] for i in (0, 1))
        return cv2.remap(self.texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)


def layered(look: Look, seed: int) -> Pair:
    """One pair of a set."""
    rng = np.random.default_rng([seed, 71])
    layers = _layers(look, rng)
    truth = _seen(layers, *_grid(look.size, 1), right=False)[0].astype(np.float64)
    sides = [_picture(layers, look, rng, right) for right in (False, True)]
    noise, gain, rows, blur = (float(rng.choice(x)) for x in (look.noise, look.gain, look.rows_px, look.blur_px))
    sides[1] = sides[1] * gain
    roll = rows / look.size[0] * rng.choice((-1, 1))
    turn = np.array([[1, 0, 0], [2 * roll, 1, rng.normal(0, rows + 1e-9) - roll * look.size[0]]])
    sides[1] = cv2.warpAffine(sides[1], turn, look.size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    shot = [_shot(cv2.GaussianBlur(side, (0, 0), blur), noise, rng) for side in sides]
    return Pair(f"{look.textures}@{seed}", *shot, truth)


def _grid(size: tuple[int, int], finer: int) -> tuple[Array, Array]:
    x, y = ((np.arange(n * finer, dtype=np.float32) + 0.5) / finer - 0.5 for n in size)
    return tuple(np.ascontiguousarray(a) for a in np.meshgrid(x, y))


def _seen(layers: list[Layer], x: Array, y: Array, right: bool) -> tuple[Array, Array, Array]:
    """Disparity of the nearest surface at pixels of one picture, which it is, and its column in the left one."""
    best = np.full(x.shape, -np.inf, np.float32)
    which, column = np.zeros(x.shape, np.int16), x.copy()
    for k, layer in enumerate(layers):
        at = x
        for _ in range(_SWEEPS * right):
            at = x + layer.disparity(at, y)
        disparity = layer.disparity(at, y)
        nearer = (disparity > best) & layer.inside(at, y)
        best[nearer], which[nearer], column[nearer] = disparity[nearer], k, at[nearer]
    return best, which, column


def _picture(layers: list[Layer], look: Look, rng: np.random.Generator, right: bool) -> Array:
    x, y = _grid(look.size, _FINER)
    _, which, column = _seen(layers, x, y, right)
    out = np.zeros((*x.shape, 3), np.float32)
    for k, layer in enumerate(layers):
        here = which == k
        if here.any():
            own = 1 + look.shade * rng.standard_normal()
            out[here] = own * layer.color(column, y)[here]
            if layer.lamp:
                out[here] += layer.lamp.light(x, y, right)[here, None]
    if look.gloss:
        soft = rng.uniform(-1, 1, (3, 4)).astype(np.float32)
        out *= 1 + look.gloss * cv2.resize(soft, x.shape[::-1], interpolation=cv2.INTER_CUBIC)[..., None]
    return cv2.resize(out, look.size, interpolation=cv2.INTER_AREA)


def _shot(picture: Array, noise: float, rng: np.random.Generator) -> Array:
    """What a sensor makes of it: noise of photons and of the amplifier, half of it common to neighbours, 8 bits."""
    strewn = rng.standard_normal(picture.shape).astype(np.float32)
    strewn = 0.7 * strewn + 0.7 * 1.6 * cv2.GaussianBlur(strewn, (0, 0), 0.6)
    return np.clip(np.rint(picture + noise * np.sqrt(0.5 + picture.clip(0) / 255) * strewn), 0, 255).astype(np.uint8)


def _layers(look: Look, rng: np.random.Generator) -> list[Layer]:
    width, height = look.size
    shared = [_noise(rng, 512) for _ in range(3)] if look.textures == "shared materials" else None
    far = rng.uniform(*look.far_px)
    floor = rng.uniform(0.3, 0.8) * (look.near_px[1] - far) / height
    horizon = rng.uniform(0.2, 0.6) * height

    def surface(level: float, slant: float, bulge: float, x0: float, y0: float, radius: float) -> Callable[..., Array]:
        bx, by = rng.uniform(-slant, slant), rng.uniform(-slant, slant)
        wave = rng.uniform(0.5, 1.5, 2)
        rise, fast, turn = 0.0, np.zeros((2, 0)), np.zeros(0)
        if look.relief_px:
            length = np.exp(rng.uniform(np.log(12), np.log(80), 2))
            rise, turn = float(rng.uniform(0, look.relief_px) * length.min() / 80), rng.uniform(0, 2 * np.pi, 2)
            fast = 2 * np.pi / length * np.array([np.cos(angles := rng.uniform(0, np.pi, 2)), np.sin(angles)])

        def at(x: Array, y: Array) -> Array:
            plane = level + bx * (x - x0) + by * (y - y0)
            if rise:
                for fx, fy, t in zip(*fast.tolist(), turn.tolist(), strict=True):
                    plane = plane + rise * np.sin(fx * x + fy * y + t)
            if look.shapes == "polygons":  # a dome
                return plane + bulge * np.sqrt(np.maximum(1 - ((x - x0) ** 2 + (y - y0) ** 2) / radius**2, 0))
            return plane + bulge * np.cos(wave[0] * 3 * (x - x0) / radius) * np.cos(wave[1] * 3 * (y - y0) / radius)

        return at

    everywhere = lambda x, y: np.ones(x.shape, bool)  # noqa: E731
    back = surface(far, 0.01, rng.uniform(0, 2), width / 2, height / 2, width / 2)
    layers = [Layer(back, everywhere, *_texture(look, rng, shared))]
    ground = partial(lambda x, y: far + floor * (y - horizon) + 0 * x)
    layers.append(Layer(ground, lambda x, y: y > horizon, *_texture(look, rng, shared)))
    for _ in range(rng.integers(*look.objects)):
        x0, y0, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(25, 140)
        level = rng.uniform(*look.near_px) * rng.uniform(0.4, 1)
        bulge = rng.uniform(0, 0.12) * level if rng.random() < 0.5 else 0.0
        shape = surface(level, look.slant, bulge, x0, y0, radius)
        layers.append(Layer(shape, _outline(look, rng, x0, y0, radius), *_texture(look, rng, shared)))
    for _ in range(rng.integers(*look.rods)):
        x0, y0, thick = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(*look.rod_px) / 2
        angle, length = rng.uniform(0, np.pi), rng.uniform(60, 250)
        c, s = np.cos(angle), np.sin(angle)

        def rod(x, y, x0=x0, y0=y0, c=c, s=s, thick=thick, length=length):
            return (np.abs(c * (x - x0) + s * (y - y0)) < thick) & (np.abs(c * (y - y0) - s * (x - x0)) < length)

        level = rng.uniform(*look.near_px)
        layers.append(Layer(surface(level, 0.03, 0.0, x0, y0, length), rod, *_texture(look, rng, shared)))
    return [_shining(layer, look, rng) for layer in layers]


def _shining(layer: Layer, look: Look, rng: np.random.Generator) -> Layer:
    """The surface as it is or, by chance, with a lamp mirrored in it."""
    if not look.shining or rng.random() >= look.shining:
        return layer
    x, y = _grid(look.size, 1)
    seen = np.argwhere(layer.inside(x, y))
    if not len(seen):
        return layer
    at = rng.choice(seen)[::-1].astype(np.float32)
    half_px, grey = np.exp(rng.uniform(np.log(8), np.log(80), 2)), np.exp(rng.uniform(np.log(40), np.log(400)))
    disparity = rng.uniform(0.3, 1.1) * float(layer.disparity(at[:1, None], at[1:, None])[0, 0])
    return replace(layer, lamp=Lamp(at, half_px.astype(np.float32), float(grey), disparity))


def _outline(look: Look, rng: np.random.Generator, x0: float, y0: float, radius: float) -> Callable[..., Array]:
    if look.shapes == "polygons":
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 7)))
        reach = radius * rng.uniform(0.5, 1, len(angles))
        # half planes: a convex outline around the middle
        return lambda x, y: (
            np.all(
                [np.cos(a) * (x - x0) + np.sin(a) * (y - y0) < r for a, r in zip(angles, reach, strict=True)], axis=0
            )
            & ((x - x0) ** 2 + (y - y0) ** 2 < (1.5 * radius) ** 2)
        )
    hole, stretch = (rng.uniform(0.4, 0.8) if rng.random() < 0.4 else 0.0), rng.uniform(0.4, 1.0)

    def disc(x: Array, y: Array) -> Array:
        square = (x - x0) ** 2 + ((y - y0) / stretch) ** 2
        return (square < radius**2) & (square >= (hole * radius) ** 2)

    return disc


def _texture(look: Look, rng: np.random.Generator, shared: list[Array] | None) -> tuple[Array, Array]:
    """A texture (1024, 1024, 3) float32 and the affine map (2, 3) from the left picture to it.

    `shared` are the materials of all surfaces, if these have the same.
    """
    angle, scale = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(0.5), np.log(2.0)))
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    to = np.column_stack([turn, rng.uniform(100, 900, 2)]).astype(np.float32)
    kinds = {"noise": _noise, "materials": _materials, "photographs": _photograph, "fine photographs": _fine_photograph}
    return _materials(rng, shared) if shared else kinds[look.textures](rng), to


def _noise(rng: np.random.Generator, n: int = 1024) -> Array:
    kind = rng.choice(["natural", "fine", "coarse", "weak", "bricks", "stripes"], p=(0.4, 0.1, 0.1, 0.2, 0.1, 0.1))
    frequency = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)) + 1 / n
    fall = {"fine": 0.3, "coarse": 2.2}.get(kind, rng.uniform(1.0, 1.6))
    grey, tint = (
        np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * frequency**-f, s=(n, n)) for f in (fall, fall + 0.5)
    )
    grey, tint = grey / grey.std(), tint / tint.std()
    contrast = rng.uniform(2, 8) if kind == "weak" else rng.uniform(12, 40)
    u, v = np.meshgrid(np.arange(n), np.arange(n))
    step = rng.integers(12, 40)
    if kind == "bricks":
        grey = 0.4 * grey + 1.5 * (((v % step) < 2) | (((u + (v // step % 2) * step) % (2 * step)) < 2))
    if kind == "stripes":
        grey = 0.4 * grey + np.sin(2 * np.pi * u / step)
    base, lean = rng.uniform(60, 190, 3), rng.uniform(-0.4, 0.4, 3)
    return (base + contrast * (grey[..., None] + lean * tint[..., None])).clip(3, 252).astype(np.float32)


def _materials(rng: np.random.Generator, made: list[Array] | None = None) -> Array:
    """Patches of materials, each with its own colour and detail, whose seams are no steps of the surface."""
    made, n = made or [_noise(rng, 512) for _ in range(3)], 512
    seams = [np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * _falling(n, 1.8), s=(n, n)) for _ in range(2)]
    detail = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * _falling(n, rng.uniform(0.4, 1.0)), s=(n, n))
    which = (seams[0] > 0).astype(int) + (seams[1] > seams[1].std())
    grain = rng.uniform(1, 10) * detail / detail.std()
    return (np.choose(which[..., None], made) + grain[..., None]).clip(3, 252).astype(np.float32)


def _falling(n: int, power: float) -> Array:
    return (np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)) + 1 / n) ** -power


def _fine_photograph(rng: np.random.Generator) -> Array:
    """A photograph at its own size beside its mirror images, with the grain of another one."""
    made, other = _photograph(rng), _photograph(rng)
    made = np.vstack([np.hstack([made, made[:, ::-1]]), np.hstack([made, made[:, ::-1]])[::-1]])
    made = cv2.resize(made, (1024, 1024), interpolation=cv2.INTER_AREA)
    grain = other - cv2.GaussianBlur(other, (0, 0), 3.0)
    return (made + rng.uniform(0.3, 1.0) * grain).clip(3, 252)


def _photograph(rng: np.random.Generator) -> Array:
    name = str(rng.choice(["astronaut", "coffee", "chelsea", "rocket", "brick", "grass", "gravel", "camera", "coins"]))
    picture = getattr(skimage.data, name)()
    picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture[..., ::-1]
    picture = cv2.resize(picture, (1024, 1024), interpolation=cv2.INTER_CUBIC).astype(np.float32)
    contrast = rng.choice([1.0, 0.6, 0.15], p=(0.5, 0.3, 0.2))
    return (rng.uniform(70, 180) + contrast * (picture - picture.mean())).clip(3, 252).astype(np.float32)
