"""Layout of the boards of the default hand when unrolled, seen from outside, with the fingertips on top."""

PALM_SIDE = (
    ("fingertip_pinkie", "fingertip_middle", "fingertip_index"),
    ("medial_front_pinkie", "medial_front_middle", "medial_front_index"),
    ("proximal_front_pinkie", "proximal_front_middle", "proximal_front_index"),
    ("", "palm", "fingertip_thumb"),
)
BACK = (
    ("medial_back_index", "medial_back_middle", "medial_back_pinkie"),
    ("proximal_back_index", "proximal_back_middle", "proximal_back_pinkie"),
    ("", "back_of_hand", ""),
)
FINGERS = ("pinkie", "middle", "index")
SIDES = (("palm side", PALM_SIDE, FINGERS), ("back of the hand", BACK, FINGERS[::-1]))

_PARTS = ("medial_front", "medial_back", "proximal_front", "proximal_back")


def get_short_name(name: str) -> str:
    """Return the short label of a board in the unrolled drawing of a hand, such as "tip".

    The label omits the name of the finger, because this name is the heading of the column in the drawing. The thumb has
    no column of its own, so the label of its fingertip is "thumb tip".
    """
    if name == "fingertip_thumb":
        return "thumb tip"
    part = name.rpartition("_")[0]
    return "tip" if part == "fingertip" else part.partition("_")[0] if part in _PARTS else name.replace("_", " ")
