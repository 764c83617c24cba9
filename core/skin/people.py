"""The persons that a body can look like: build and colours."""

from shape import Build

FACE = {"eyes": (44, 36, 34), "soles": (238, 238, 234)}
PEOPLE = {
    "alex": (
        Build(),
        FACE | {"skin": (214, 166, 136), "hair": (58, 42, 34), "brows": (70, 50, 40), "lips": (186, 120, 106),
                "shirt": (62, 120, 172), "trousers": (60, 64, 80), "shoes": (192, 192, 198)},
    ),
    "sam": (
        Build(waist=-0.012, chest=-0.006, bust=0.010, hips=0.006, limbs=0.94, jaw=0.93, hair="bun"),
        FACE | {"skin": (152, 104, 76), "hair": (34, 27, 25), "brows": (40, 30, 27), "lips": (138, 76, 70),
                "shirt": (214, 148, 52), "trousers": (74, 92, 124), "shoes": (70, 66, 70)},
    ),
    "kim": (
        Build(waist=-0.008, chest=-0.008, bust=0.006, hips=0.002, limbs=0.93, jaw=0.95, hair="long"),
        FACE | {"skin": (236, 198, 168), "hair": (30, 27, 30), "brows": (44, 38, 38), "lips": (204, 128, 118),
                "shirt": (90, 146, 106), "trousers": (104, 94, 88), "shoes": (228, 224, 216)},
    ),
    "max": (
        Build(waist=0.022, chest=0.010, hips=0.006, limbs=1.07, jaw=1.08, hair="bald"),
        FACE | {"skin": (206, 154, 124), "hair": (60, 50, 44), "brows": (84, 62, 48), "lips": (180, 112, 98),
                "shirt": (164, 66, 62), "trousers": (96, 88, 74), "shoes": (88, 62, 46)},
    ),
}  # fmt: skip
