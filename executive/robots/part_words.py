"""Words in names of links and joints that tell what a part is, where the structure of the tree leaves it open.

Names are split into words at punctuation, digits and changes of case: "LHand_joint2" has the words "l", "hand" and
"joint". An entry is a regular expression that matches whole words, or several words joined.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum
from functools import cache


class Part(Enum):
    """A kind of part that names tell."""

    WHEEL = "wheel"
    FINGER = "finger"
    THUMB = "thumb"
    HAND = "hand"
    WRIST = "wrist"
    HEAD = "head"
    LEG = "leg"
    PASSIVE = "passive"
    CAMERA = "camera"
    MOUNT = "mount"
    COLOUR = "colour"
    NO_PICTURE = "no picture"
    SPRING = "spring"
    SENSOR = "sensor"


_WORDS: Mapping[Part, str] = {
    Part.WHEEL: r"\w*wheels?\w*|castors?|casters?|\w*caster\w*|rollers?|rotors?|propellers?|mecanum|omni|"
    r"raeder|roue|rueda|ruota|sharin",
    Part.FINGER: r"\w*finger\w*|\w*fngr\w*|\w*thumb\w*|\w*jaw\w*|\w*claw\w*|\w*knuckle\w*|phalanx|tongs?|"
    r"index|middle|ring|pinky|little|proximal|distal|daumen|doigts?|pouce|dedos?|pulgar|dit[oa]|pollice|yubi|zhi",
    Part.THUMB: r"\w*thumb\w*|daumen|pouce|pulgar|pollice|oyayubi|th",
    Part.HAND: r"\w*grip\w*|\w*hand|hands|\w*pinch\w*|palm|grasper|clamp|"
    r"greifer\w*|pince\w*|pinza|mano|jiazhua|zhua",
    Part.WRIST: r"\w*wrist\w*|roll|rotate|rotation|twist|yaw|pitch|swivel|turn|spin",
    Part.HEAD: r"heads?|necks?|eyes?|kopf|hals|tete|cabeza|cuello|testa|collo|kubi|atama",
    Part.LEG: r"legs?|foot|feet|ankles?|knees?|thighs?|calf|calves|toes?|hips?|soles?|shanks?|shins?|"
    r"tibia|femur|pelvis|uleg|lleg|bein|fuss|knie|jambe|pied|pierna|gamba|piede|ashi",
    Part.PASSIVE: r"lamps?|lights?|leds?|lasers?|lidars?|radars?|antennas?|cables?|hoses?|bellows|imu|camera|cam|"
    r"linkage|dummy|logo|gauge|lampe|licht|kabel",
    Part.CAMERA: r"\w*camera\w*|\w*kinect\w*|\w*realsense\w*|\w*openni\w*|\w*xtion\w*|\w*stereo\w*|\w*rgbd?|"
    r"zed|astra|orbbec|oak|webcam|kamera|cams?|d4[0-9]5\w*",
    Part.MOUNT: r"mounts?|motor|screw|pole|adapter|bracket|gazebo|holder",
    Part.COLOUR: r"\w*rgbd?|colou?r|\w*stereo",
    Part.SPRING: r"springs?|compliant|compliance|elastic",
    Part.SENSOR: r"ft|sensors?|force|torque|dummy|bumpers?|encoders?",
    Part.NO_PICTURE: r"depth|infra\w*|ir|imu|gyro|accel|range|line",
}
_TOOL = re.compile(r"tool|tcp|grip_?point|grasp|flange", re.IGNORECASE)
_SPLIT = re.compile(r"[dD]4\d5\w?|[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


@cache
def words_of(name: str) -> tuple[str, ...]:
    """Split a name into words, in lower case."""
    return tuple(word.lower() for word in _SPLIT.findall(name))


def names(part: Part, *texts: str) -> bool:
    """Check whether one of some names has a word for a kind of part."""
    pattern = re.compile(_WORDS[part])
    return any(pattern.fullmatch(word) for text in texts for word in words_of(text))


def is_tool(link: str) -> bool:
    """Check whether a link is named as the point of a tool."""
    return _TOOL.search(link) is not None
