"""The virtual rig's laser: it casts rays into a scene and sends what an XV-11 would send.

What is taken from a real sensor and what is chosen:

* Noise ``sigma = a + b r^2``: fitted with `stereolib.laser.fit_sigma` to four figures, 1.5 mm below 1 m, 4.1 mm at
  1-1.5 m, 7.4 mm at 2.5-3 m, 14.8 mm at 3-3.3 m (taken at 0.6, 1.25, 2.75 and 3.15 m; the law misses them by 22 % rms).
  They are said to be the repeatability of one real unit, of a recording that cannot be traced any more: take the law as
  chosen. The real unit of ``data/real/xv11_static_turns.csv`` is quieter at every distance (notebook 05).
* Strength ``s = k reflectance / r^2``, k from a public recording of a real sensor in a cardboard box:
  median 837 counts at 0.3 m, 591 at 0.35-0.45 m, 419 at 0.45-0.55 m.
* Bias and the two thresholds are chosen, as no public measurement of them is known: the bias stays
  within the 3 cm out to 6 m of Konolige et al., "A low-cost laser distance sensor", ICRA 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stereolib import laser
from stereolib.base import Float64, direction
from stereolib.laser import (
    BEAMS,
    EMITTER_ANGLE_RAD,
    EMITTER_OFFSET_MM,
    NOMINAL_RPM,
    PACKETS_PER_TURN,
    READINGS_PER_PACKET,
)
from stereolib.virtual.ray_casting import cast_rays
from stereolib.virtual.scene import Scene

NO_ECHO, OUT_OF_RANGE = laser.ERROR_NO_SIGNAL, 0x02  # error codes
_LEAST_REFLECTANCE = 1e-3  # below it the laws of noise and bias are not followed further
_WANDER_RPM, _MOST_WANDER_RPM = 0.05, 3.0  # from packet to packet, and at most


@dataclass(frozen=True)
class VirtualLidar:
    """A laser range finder on the virtual rig.

    Parameters
    ----------
    height_mm : float
        Height of the scanned plane above the floor.
    sigma_mm, sigma_per_mm : float
        Noise ``sigma_mm + sigma_per_mm r^2`` (mm and 1/mm) of surfaces of reflectance `noisy_below`
        and more; darker ones have ``sqrt(noisy_below / reflectance)`` times as much.
    bias_mm : (c0, c1, c2)
        Bias ``c0 + c1 R + c2 R^2``, R in metres, of a surface of reflectance 0.5.
    bias_dark_mm : float
        Further bias for each tenfold loss of reflectance.
    strength : float
        Signal of a white surface at 1 m, counts.
    least_strength : float
        Half of the readings drop out at this signal; below twice it they carry the warning.
    min_mm, max_mm : float
        Range the sensor measures in.
    speed_rpm : float
        Motor speed; it wanders by a fraction of an rpm.
    emitter_offset_mm : float
        How far beside its axis its light starts, mm: an XV-11's, unless given. No packet tells; for another one say it
        to `stereolib.laser.turns` too.

    Notes
    -----
    Reflectance is albedo times the cosine of the angle of incidence times (1 - gloss): what a
    grazing, dark or shiny surface sends back.
    """

    height_mm: float = 100.0
    sigma_mm: float = 1.3
    sigma_per_mm: float = 1.2e-6
    noisy_below: float = 0.25
    bias_mm: tuple[float, float, float] = (0.0, -0.6, 0.8)
    bias_dark_mm: float = 2.5
    strength: float = 200.0
    least_strength: float = 3.0
    min_mm: float = 100.0
    max_mm: float = 6000.0
    speed_rpm: float = NOMINAL_RPM
    emitter_offset_mm: float = EMITTER_OFFSET_MM

    def sigma(self, distance_mm: ArrayLike, reflectance: ArrayLike = 1.0) -> Float64:
        """Compute the standard deviation of readings.

        Parameters
        ----------
        distance_mm : array_like, mm
        reflectance : array_like, 0..1

        Returns
        -------
        float64 array, mm

        Examples
        --------
        >>> VirtualLidar().sigma([500, 1000, 3000])
        array([ 1.6,  2.5, 12.1])
        """
        r, rho = np.asarray(distance_mm, np.float64), np.asarray(reflectance, np.float64)
        darker = np.maximum(self.noisy_below / np.maximum(rho, _LEAST_REFLECTANCE), 1.0)
        return np.asarray((self.sigma_mm + self.sigma_per_mm * r**2) * np.sqrt(darker))

    def bias(self, distance_mm: ArrayLike, reflectance: ArrayLike = 0.5) -> Float64:
        """Compute the systematic error of readings.

        Parameters
        ----------
        distance_mm : array_like, mm
        reflectance : array_like, 0..1

        Returns
        -------
        float64 array, mm
        """
        r, rho = np.asarray(distance_mm, np.float64), np.asarray(reflectance, np.float64)
        by_range = np.polynomial.polynomial.polyval(r / 1000, self.bias_mm)
        return np.asarray(by_range + self.bias_dark_mm * np.log10(0.5 / np.maximum(rho, _LEAST_REFLECTANCE)))

    def truth_mm(self, scene: Scene, pose: Sequence[float]) -> Float64:
        """Compute the exact range of every beam.

        Parameters
        ----------
        scene : Scene
        pose : (x_mm, y_mm, yaw_rad)
            Where the sensor stands in the world and where its beam 0 looks.

        Returns
        -------
        (360,) float64, mm
            NaN where a beam meets nothing.
        """
        return self._cast(scene, pose)[0]

    def scan(self, scene: Scene, pose: Sequence[float], rng: np.random.Generator, turns: int = 5) -> bytes:
        """Turn in a scene, and send the bytes that an XV-11 sends meanwhile.

        Parameters
        ----------
        scene : Scene
        pose : (x_mm, y_mm, yaw_rad)
            Where the sensor stands in the world and where its beam 0 looks.
        rng : numpy.random.Generator
        turns : int
            Turns of 90 packets.

        Returns
        -------
        bytes

        Raises
        ------
        ValueError
            For no turn, or if the pose has not three numbers.

        Examples
        --------
        >>> from stereolib.virtual import cube_scene
        >>> len(VirtualLidar().scan(cube_scene(), (0, 0, 0), np.random.default_rng(0), turns=1))
        1980
        """
        if turns < 1:
            raise ValueError(f"turns must be 1 or more, got {turns}")
        distance, reflectance = self._cast(scene, pose)
        shape = (turns, BEAMS)
        return self._send(np.broadcast_to(distance, shape), np.broadcast_to(reflectance, shape), rng)

    def range_series(
        self, distances_mm: ArrayLike, albedo: float, rng: np.random.Generator, readings: int = 360
    ) -> list[bytes]:
        """Make one recording for each known distance to a target that is met at right angles.

        Every beam meets the target (as inside a round screen), so that one turn brings 360 readings
        of the same distance.

        Parameters
        ----------
        distances_mm : (k,) array_like
            Known distances, mm.
        albedo : float
            Reflectance of the target, 0..1; `recordings.TARGETS` has those of the usual ones.
        rng : numpy.random.Generator
        readings : int
            Readings at each distance, rounded up to whole turns.

        Returns
        -------
        list of bytes

        Raises
        ------
        ValueError
            For a reflectance, distance or number of readings that cannot be.
        """
        if not 0 < albedo <= 1:
            raise ValueError(f"albedo is a share of the light, 0 < albedo <= 1; got {albedo}")
        if readings < 1:
            raise ValueError(f"readings must be 1 or more, got {readings}")
        shape = (-(-readings // BEAMS), BEAMS)
        known = np.asarray(distances_mm, np.float64).ravel()
        if not (known > 0).all():
            raise ValueError("distances must be positive, in mm")
        return [self._send(np.full(shape, d), np.full(shape, albedo), rng) for d in known]

    def _cast(self, scene: Scene, pose: Sequence[float]) -> tuple[Float64, Float64]:
        if len(pose) != 3:
            raise ValueError(f"a pose is (x_mm, y_mm, yaw_rad), got {len(pose)} numbers")
        x, y, yaw = pose
        angle = np.asarray(yaw + np.arange(BEAMS) * (2 * np.pi / BEAMS), np.float64)
        flat = np.zeros(BEAMS)
        beam = np.column_stack([direction(angle), flat])
        side = np.column_stack([direction(angle + EMITTER_ANGLE_RAD), flat])
        origin = np.array([x, y, self.height_mm]) + self.emitter_offset_mm * side
        hits = cast_rays(scene, origin, beam)
        cosine = np.abs(np.einsum("nk,nk->n", hits.normal, beam))
        reflectance = hits.albedo * cosine * (1 - hits.gloss)
        return hits.distance_mm, np.where(np.isfinite(hits.distance_mm), reflectance, 0.0)

    def _send(self, distance: Float64, reflectance: Float64, rng: np.random.Generator) -> bytes:
        """Readings of the true distances (turns, 360), with all faults, as packets."""
        noise, chance = rng.standard_normal(distance.shape), rng.random(distance.shape)
        near = np.where(np.isnan(distance), np.inf, distance)
        signal = self.strength * reflectance / (near / 1000) ** 2
        measured = distance + self.bias(distance, reflectance)
        measured = np.rint(measured + noise * self.sigma(distance, reflectance))
        # a soft threshold: half lost at least_strength, none to speak of at three times as much
        lost = chance < 1 / (1 + (signal / self.least_strength) ** 4)
        beyond = ~((near >= self.min_mm) & (near <= self.max_mm))
        beyond |= ~((measured >= 0) & (measured <= laser.MAX_DISTANCE_MM))
        code = np.where(beyond & np.isfinite(near), OUT_OF_RANGE, NO_ECHO)
        packets = (distance.size // READINGS_PER_PACKET, READINGS_PER_PACKET)
        wander = np.cumsum(rng.normal(0, _WANDER_RPM, packets[0]))
        readings = laser.Readings.build(
            np.arange(packets[0]) % PACKETS_PER_TURN,
            np.where(lost | beyond, np.nan, measured).reshape(packets),
            np.clip(np.rint(signal), 0, 0xFFFF).astype(int).reshape(packets),
            speed_rpm=self.speed_rpm + np.clip(wander, -_MOST_WANDER_RPM, _MOST_WANDER_RPM),
            error_code=code.reshape(packets),
            warning=((signal < 2 * self.least_strength) & (signal > 0)).reshape(packets),
        )
        return laser.encode(readings)
