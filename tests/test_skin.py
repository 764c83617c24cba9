"""The body's looks: closed meshes that follow the joints, and hold to the collision shapes."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from humanclaw import HumanclawError
from humanclaw.body import JOINT_INDEX, LINKS, REGIONS, SKINS, Box, forward_kinematics, rest_pose, skin

WRIST = JOINT_INDEX["left_wrist"]


@pytest.fixture(params=SKINS)
def looks(request):
    return skin(request.param)


def places_of(looks):
    """Return (M, 3) the number of each corner's place: vertices of two regions at one place count once."""
    _, places = np.unique(np.round(looks.vertices * 1e4), axis=0, return_inverse=True)
    return places.ravel()[looks.faces]


def distances(points, link, place, turn):
    """Return how far points are outside a link's shape, metres; negative inside."""
    local, shape = (points - place) @ turn, link.shape
    if isinstance(shape, Box):
        beyond = np.abs(local - shape.centre) - shape.half
        return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
    a, b = np.array(shape.a), np.array(shape.b)
    share = np.clip((local - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(local - a - share[:, None] * (b - a), axis=1) - shape.radius


def test_each_skin_is_closed_and_small(looks):
    places = places_of(looks)
    assert (places != np.roll(places, 1, axis=1)).all(), "no face is a line"
    sides = np.concatenate([places[:, [0, 1]], places[:, [1, 2]], places[:, [2, 0]]])
    there, count = np.unique(sides, axis=0, return_counts=True)
    assert (count == 1).all()
    assert set(map(tuple, there.tolist())) == set(map(tuple, there[:, ::-1].tolist())), (
        "each edge has a face on both sides"
    )
    assert len(looks.faces) < 8000


def test_faces_look_outwards_and_hold_a_persons_volume(looks):
    a, b, c = (looks.vertices[looks.faces[:, k]].astype(float) for k in range(3))
    # Positive if the faces look outwards. A person is about as dense as water.
    assert 60 < 1000 * np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 < 100


def pieces(looks, along):
    """Return how many closed curves a plane across the left hand cuts. along: metres from the wrist."""
    places, turns = forward_kinematics(np.zeros(3), looks.bind)
    hand = ((looks.vertices - places[WRIST]) @ turns[WRIST])[looks.faces]
    beside = (np.linalg.norm(hand, axis=2) < 0.25).all(axis=1)
    a, b, c = places_of(looks)[beside & (hand[..., 0].min(axis=1) < along) & (hand[..., 0].max(axis=1) > along)].T
    rows, columns = np.concatenate([a, b]), np.concatenate([b, c])
    size = 1 + max(rows.max(), columns.max())
    _, label = connected_components(csr_array((np.ones(len(rows)), (rows, columns)), (size, size)), directed=False)
    return len(np.unique(label[rows]))


def test_hands_have_a_thumb_and_four_fingers(looks):
    """The thumb ends before the middles of the fingers; the middle finger ends 0.108 of the stature from the wrist."""
    assert [pieces(looks, along) for along in (0.03, 0.09, 0.14)] == [1, 2, 4]
    places, turns = forward_kinematics(np.zeros(3), looks.bind)
    follows = np.isin(looks.frames[:, 0], [WRIST, JOINT_INDEX["left_hand"]])
    reach = ((looks.vertices[follows] - places[WRIST]) @ turns[WRIST])[:, 0].max()
    assert reach == pytest.approx(0.108 * 1.72, abs=0.01)


def test_weights_are_shares_of_at_most_four_frames(looks):
    assert looks.frames.shape == looks.weights.shape == (len(looks.vertices), 4)
    assert looks.frames.max() < 48
    assert (looks.weights >= 0).all()
    assert looks.weights.sum(axis=1) == pytest.approx(np.ones(len(looks.vertices)), abs=1e-6)


def test_every_region_has_vertices_and_a_colour(looks):
    assert set(np.unique(looks.regions)) >= {
        REGIONS.index(name) for name in ("skin", "shirt", "trousers", "shoes", "eyes")
    }
    assert looks.colours.shape == (len(REGIONS), 3)


def test_the_bind_pose_gives_back_the_vertices(looks):
    vertices, normals = looks.posed(np.zeros(3), looks.bind)
    assert vertices == pytest.approx(looks.vertices, abs=1e-6)
    assert normals == pytest.approx(looks.normals, abs=1e-6)


def test_what_follows_one_joint_moves_as_a_rigid_body(looks):
    """Turn the body by a quarter to the left, lift it by 2 m, and bend the left elbow: the hand follows by hand."""
    rotations = looks.bind.copy()
    rotations[0] = (0, np.pi / 2, 0)
    rotations[JOINT_INDEX["left_elbow"]] = (0, -1.2, 0)
    vertices, _ = looks.posed(np.array([0.0, 2.0, 0.0]), rotations)
    rigid = (looks.frames[:, 0] == WRIST) & (looks.weights[:, 0] == 1)
    assert rigid.sum() > 10
    before, turn_before = forward_kinematics(np.zeros(3), looks.bind)
    after, turn_after = forward_kinematics(np.array([0.0, 2.0, 0.0]), rotations)
    expected = (looks.vertices[rigid] - before[WRIST]) @ turn_before[WRIST] @ turn_after[WRIST].T + after[WRIST]
    assert vertices[rigid] == pytest.approx(expected, abs=1e-5)
    pelvis = (looks.frames[:, 0] == 0) & (looks.weights[:, 0] == 1)
    x, y, z = looks.vertices[pelvis].T
    assert vertices[pelvis] == pytest.approx(np.stack([z, y + 2, -x], 1), abs=1e-5)


def test_a_knee_bent_by_120_degrees_keeps_its_thickness(looks):
    """The shin's and the thigh's circumference near the knee is what it was: skin that collapses would be thinner."""
    rotations = looks.bind.copy()
    rotations[JOINT_INDEX["left_knee"]] = (np.radians(120), 0, 0)
    bent, _ = looks.posed(np.zeros(3), rotations)
    knee = JOINT_INDEX["left_knee"]
    places, _ = forward_kinematics(np.zeros(3), looks.bind)
    near = np.linalg.norm(looks.vertices - places[knee], axis=1) < 0.075
    now = np.linalg.norm(bent[near] - places[knee], axis=1)
    before = np.linalg.norm(looks.vertices[near] - places[knee], axis=1)
    assert np.percentile(now / before, 10) > 0.8


def test_the_surface_lies_near_the_collision_shapes(looks):
    rest = rest_pose()
    vertices, _ = looks.posed(rest.root[0], rest.rotations[0])
    places, turns = forward_kinematics(rest.root[0], rest.rotations[0])
    far = [distances(vertices, link, places[JOINT_INDEX[link.joint]], turns[JOINT_INDEX[link.joint]]) for link in LINKS]
    away = np.abs(np.min(far, axis=0))
    # Collision shapes have neither shoulders, nor thumbs, nor a nose, nor hair.
    away = away[looks.regions != REGIONS.index("hair")]
    assert (away < 0.02).mean() > 0.84
    assert away.max() < 0.06


def test_soles_stand_flat_on_the_floor(looks):
    rest = rest_pose()
    vertices, _ = looks.posed(rest.root[0], rest.rotations[0])
    soles = vertices[looks.regions == REGIONS.index("soles")]
    assert soles[:, 1].min() == pytest.approx(0, abs=0.004)
    assert (soles[:, 1] < 0.005).mean() > 0.3


def test_a_folded_head_leaves_the_body_closed(looks):
    rest = rest_pose()
    vertices, _ = looks.posed(rest.root[0], rest.rotations[0])
    neck = rest.joints()[0, JOINT_INDEX["neck"]]
    folded = looks.headless(vertices, neck)
    assert vertices[:, 1].max() == pytest.approx(1.72, abs=0.05)
    assert folded[:, 1].max() < neck[1] + 0.06
    moved = (folded != vertices).any(axis=1)
    assert not moved[looks.regions == REGIONS.index("trousers")].any()


def test_an_unknown_skin_is_refused_with_the_known_ones():
    with pytest.raises(HumanclawError, match=r"no skin 'robot'\. Choose from: alex, sam, kim, max"):
        skin("robot")
