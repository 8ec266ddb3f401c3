"""Why something was not measured, and which sensor gave what: names for programs, texts for people."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Reason(Enum):
    """Why a size, or a whole object, was not measured."""

    DEPTH_HIDDEN = "only one face is seen, its depth is hidden: turn the object or move the rig to see a corner"
    CUT = "an end lies outside of one of the pictures: step back, or turn the rig towards it"
    TOP_CUT = "the object's top lies above the picture or on its border: step back or tilt the camera up"
    FOOT_CUT = "its foot lies below the picture: step back or tilt the camera down"
    HIDDEN = "an end is hidden by something nearer"
    TOO_UNCERTAIN = "too uncertain; turn the object, light or texture it, or move the rig"
    CONTRADICTION = "its edges contradict each other: see that it is a box, and that nothing touches it"
    IN_ANOTHER = (
        "it and another object would stand in one another, so one of them is mistaken: move them apart, or change "
        "light or background"
    )
    IN_THE_AIR = "it does not stand on the floor, or is too plain to be followed to it; put it down, or texture it"
    LEANS = "it leans; put it upright"
    MAY_LEAN = "it may lean; put it upright, or change light or background"
    NO_EDGE = "its outline does not stand out; change light or background"
    NO_FACE = "no straight face was found"
    NO_TEXTURE = "no texture: the pair matched too little there; light or texture it"
    NO_FLOOR = "no floor was seen"
    NOT_IN_SCAN = (
        "it is not in the scan (lower than its plane, or dark, or the scan is turned): its sizes come from the pair "
        "alone"
    )
    OTHERWISE_IN_SCAN = (
        "the scan shows something nearer or farther where it stands (moved since, or a scan of another place, or a "
        "turned laser): its sizes come from the pair alone"
    )
    OTHER_IN_SCAN = (
        "nobody knows whether the pictures show a part of it (by a print, say), or two things as one, or the scan is "
        "of another place or moment: light it better, move it apart from others, or measure without the scan"
    )
    SCAN_IRREGULAR = "the scan shows no box there, or is too noisy to show one: its sizes come from the pair alone"
    NOT_IN_PICTURE = "outside the picture: turn the rig towards it"
    ONE_CAMERA = "only one camera sees it whole: turn the rig towards it"
    TOO_FAR = "too far for the pair: go nearer"
    ROUND = "its outline is round, and too uncertain"
    IRREGULAR = "its outline is irregular"

    @property
    def short(self) -> str:
        """Its short name, as "no texture"."""
        return self.name.lower().replace("_", " ")

    @property
    def leaves_the_pair(self) -> bool:
        """The scan tells nothing of the object, and the pair all."""
        return self in (Reason.NOT_IN_SCAN, Reason.OTHERWISE_IN_SCAN, Reason.SCAN_IRREGULAR)


@dataclass(frozen=True)
class Why:
    """A reason, and what was seen of it.

    Attributes
    ----------
    reason : Reason
    seen : str
        Numbers of this case; may be empty.
    """

    reason: Reason
    seen: str = ""

    def __str__(self) -> str:
        return f"{self.seen}: {self.reason.value}" if self.seen else self.reason.value


class ScanFit(Enum):
    """Whether a scan is of what the pictures show."""

    AGREES = "the scan shows an object where the pictures do"
    OPPOSES = (
        "the scan agrees with nothing that the pictures show: is it of this place and moment, its distances in mm, its "
        "angles in degrees, counter-clockwise, 0 where the cameras look? Or was a camera turned sideways (stereolib "
        "check tells)?"
    )
    UNTOLD = "no object is shown by both"


class Source(Enum):
    """Which sensor something is known from."""

    SCAN = "scan"
    IMAGE = "image"
    BOTH = "scan and image"

    def __str__(self) -> str:
        return self.value


#: Why a size is unsure, by the kind of observation that gave most of its variance, and what helps.
UNSURE = {
    "floor": "the floor is known no better: let the pictures show more of it, or give it (measure --floor)",
    "laser": "the laser's place is known no better: run calibrate-laser with more poses",
    "cameras": "the calibration knows the cameras no better: take more pairs of the board, where this stands",
    "PlaneSeen": "the pictures tell too little of how its faces stand: go nearer, light or texture it",
    "EdgeSeen": "its edges are seen too small or too faintly in the pictures: go nearer, change light or background",
    "RangesSeen": "few readings of the laser, or far ones, tell where its faces stand: go nearer, turn a face to it",
    "EndBetweenBeams": "the laser alone tells an end, somewhere between two beams: go nearer, or turn the rig so that "
    "both cameras see it",
}
#: Reasons for which neither pictures nor scan tell any size.
NOT_STANDING = (Reason.IN_THE_AIR, Reason.LEANS, Reason.MAY_LEAN)
