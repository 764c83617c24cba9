"""Drive a body from a script: python examples/drive.py [PICTURE.png]"""

import sys

from PIL import Image

from humanclaw import Body


def main(picture: str = "view.png") -> None:
    with Body(scene="house:0") as body:
        for params in ({"z_cm": 40, "x_cm": 0, "yaw_deg": 0}, {"z_cm": 60, "x_cm": 0, "yaw_deg": 10}):
            body.call("walk", **params)
        observation = body.call("turn_in_place", yaw_deg=45)
        x, _, z = body.state().body.root[-1]
        print(f"{observation.feedback} The hips are at x {x:.2f} m, z {z:.2f} m.")
    Image.fromarray(observation.rgb).save(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
