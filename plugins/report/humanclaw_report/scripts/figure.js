// The body of the replay: a skin that follows the joints, as humanclaw.body.Skin poses it.
// @ts-check
/// <reference path="viewer.js" />
"use strict";

/** @typedef {{offsets: number[][], parents: number[], gaze: {ahead: number, pitch: number}}} BodyData */

const NECK = 12, HEAD = 15;
const TOUCHED = [1, 0.36, 0.01]; // Linear red, green and blue of skin in contact.

/** The skin in its bind pose; figures share it. */
class Skin {
  /** @param {Record<string, any>} arrays @param {number} looks number of its colours */
  constructor(arrays, looks = 0) {
    this.arrays = arrays;
    this.bind = arrays.bind;
    this.frames = arrays.frames;
    this.shape = new THREE.BufferGeometry();
    const metres = (/** @type {Int16Array} */ values) => new THREE.BufferAttribute(Float32Array.from(values, (value) => value / 1e4), 3);
    this.shape.setAttribute("position", metres(arrays.vertices));
    this.shape.setAttribute("normal", metres(arrays.normals));
    this.shape.setAttribute("skinIndex", new THREE.Uint16BufferAttribute(Uint16Array.from(arrays.frames), 4));
    this.shape.setAttribute("skinWeight", new THREE.BufferAttribute(Float32Array.from(arrays.weights, (/** @type {number} */ share) => share / 255), 4));
    this.shape.setIndex(new THREE.BufferAttribute(arrays.faces, 1));
    this.plain = this.colours(looks);
    this.shape.setAttribute("color", new THREE.BufferAttribute(this.plain.slice(), 3));
    this.marked = "";
  }

  /** Red, green and blue of each vertex; light is computed with linear ones. @param {number} looks */
  colours(looks) {
    const { regions, palettes } = this.arrays;
    const tone = (/** @type {number} */ k) => palettes[27 * looks + 3 * regions[Math.floor(k / 3)] + (k % 3)];
    return Float32Array.from({ length: 3 * regions.length }, (_, k) => Math.pow(tone(k) / 255, 2.2));
  }

  /** The same skin in other colours, for a body whose contacts are not shown. @param {number} looks @returns {Skin} */
  worn(looks) {
    const other = Object.assign(Object.create(Skin.prototype), this);
    other.shape = this.shape.clone();
    other.shape.setAttribute("color", new THREE.BufferAttribute(this.colours(looks), 3));
    return other;
  }

  /** Colour what follows these joints. @param {Set<number>} joints */
  mark(joints) {
    const marked = [...joints].sort().join();
    if (marked === this.marked) return;
    this.marked = marked;
    const colours = /** @type {THREE.BufferAttribute} */ (this.shape.getAttribute("color"));
    const values = /** @type {Float32Array} */ (colours.array);
    values.set(this.plain);
    for (let vertex = 0; vertex < this.frames.length / 4; vertex += 1) {
      if (joints.has(this.frames[4 * vertex] % 24)) values.set(TOUCHED, 3 * vertex);
    }
    colours.needsUpdate = true;
  }
}

/** A body: 24 joints, then the same joints turned half as far, and the skin over them. */
class Figure {
  /** @param {BodyData} body @param {Skin} skin @param {THREE.Material} material */
  constructor(body, skin, material) {
    const count = body.offsets.length;
    this.root = new THREE.Group();
    this.joints = body.offsets.map(() => new THREE.Bone());
    this.halves = body.offsets.map(() => new THREE.Bone());
    this.joints.forEach((joint, index) => {
      const parent = body.parents[index] < 0 ? this.root : this.joints[body.parents[index]];
      for (const bone of [joint, this.halves[index]]) {
        if (index) bone.position.fromArray(body.offsets[index]);
        parent.add(bone);
      }
    });
    this.from = new THREE.Quaternion();
    this.to = new THREE.Quaternion();
    for (let index = 0; index < count; index += 1) this.turn(index, this.from.fromArray(skin.bind, 4 * index));
    this.root.updateMatrixWorld(true);
    this.mesh = new THREE.SkinnedMesh(skin.shape, material);
    this.mesh.frustumCulled = false; // Its bounds are those of the bind pose.
    this.root.add(this.mesh);
    this.mesh.bind(new THREE.Skeleton([...this.joints, ...this.halves]), new THREE.Matrix4());
  }

  /** @param {number} index @param {THREE.Quaternion} turn */
  turn(index, turn) {
    this.joints[index].quaternion.copy(turn);
    if (index) this.halves[index].quaternion.identity().slerp(turn, 0.5);
    else this.halves[index].quaternion.copy(turn);
  }

  /** @param {ArrayLike<number>} root @param {ArrayLike<number>} turns @param {number} time */
  pose(root, turns, time) {
    const [frame, next, share] = between(time, root.length / 3);
    const place = mixed(root, frame, next, share, 3);
    for (const bone of [this.joints[0], this.halves[0]]) bone.position.copy(place);
    this.joints.forEach((_, index) => {
      const at = (/** @type {number} */ f) => 4 * (f * this.joints.length + index);
      this.from.set(turns[at(frame)], turns[at(frame) + 1], turns[at(frame) + 2], turns[at(frame) + 3]).normalize();
      this.to.set(turns[at(next)], turns[at(next) + 1], turns[at(next) + 2], turns[at(next) + 3]).normalize();
      this.turn(index, this.from.slerp(this.to, share));
    });
  }

  /** Fold head and neck away, for eyes inside the head. @param {boolean} folded */
  fold(folded) {
    // Not 0: a matrix without an inverse has no normals.
    for (const bone of [this.joints[NECK], this.halves[NECK]]) bone.scale.setScalar(folded ? 1e-3 : 1);
  }

  /** @param {number} joint */
  place(joint) {
    return this.joints[joint].getWorldPosition(new THREE.Vector3());
  }
}
