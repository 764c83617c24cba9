// The body in its house, in 3D. Draws one moment on request; the player in episode.js keeps the time.
// @ts-check
"use strict";

/** @typedef {{name: string, type: "uint8" | "int16" | "uint16" | "uint32" | "float32", shape: number[]}} Head */
/** @typedef {{arrays: Head[], bytes: string}} Packed */
/** @typedef {{vertices: [number, number], faces: [number, number], picture: number}} AssetData */
/** @typedef {{id: number, asset: number, name: string, kind: string, place: number[], box: number[][]}} ObjectData */
/** @typedef {{assets: AssetData[], objects: ObjectData[], pictures: string[], meshes: Packed}} House */
/** @typedef {{fps: number, frames: number, camera: [number, number], body: BodyData, looks: number[], contacts: [number, number, number, string][], floors: number[], targets: number[][][], motion: Packed}} Replay */
/** @typedef {"follow" | "free" | "above" | "ego"} View */

/** @typedef {Uint8Array | Int16Array | Uint16Array | Uint32Array | Float32Array} Values */

const ARRAYS = { uint8: Uint8Array, int16: Int16Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };
const FADED = 0.1;
const STOREY = 2.2; // Objects that begin higher than this above a floor hide the body from above, metres.

/** Unpack the arrays of `packed` in replay.py. @param {Packed} packed @returns {Promise<Record<string, Values>>} */
async function unpack(packed) {
  const zipped = Uint8Array.from(atob(packed.bytes), (letter) => letter.charCodeAt(0));
  const stream = new Blob([zipped]).stream().pipeThrough(new DecompressionStream("gzip"));
  const buffer = await new Response(stream).arrayBuffer();
  /** @type {Record<string, Values>} */
  const found = {};
  let start = 0;
  for (const { name, type, shape } of packed.arrays) {
    const count = shape.reduce((product, size) => product * size, 1);
    found[name] = new ARRAYS[type](buffer, start, count);
    start += 4 * Math.ceil((count * ARRAYS[type].BYTES_PER_ELEMENT) / 4);
  }
  return found;
}

/** The frames before and after a time, and the share of the way to the second. @param {number} time @param {number} count @returns {[number, number, number]} */
function between(time, count) {
  const held = Math.max(0, Math.min(time, count - 1));
  const frame = Math.floor(held);
  return [frame, Math.min(frame + 1, count - 1), held - frame];
}

/** @param {ArrayLike<number>} values @param {number} a @param {number} b @param {number} share @param {number} stride */
function mixed(values, a, b, share, stride) {
  const at = (/** @type {number} */ k) => values[stride * a + k] * (1 - share) + values[stride * b + k] * share;
  return new THREE.Vector3(at(0), at(1), at(2));
}

/** One object of the house, which can be hidden or faded. */
class Furnishing {
  /** @param {ObjectData} data @param {THREE.Mesh} mesh */
  constructor(data, mesh) {
    this.data = data;
    this.mesh = mesh;
    this.box = new THREE.Box3(new THREE.Vector3().fromArray(data.box[0]), new THREE.Vector3().fromArray(data.box[1]));
    this.material = /** @type {THREE.MeshLambertMaterial} */ (mesh.material);
    /** @type {Furnishing[]} */
    this.hung = [];
  }

  /** @param {boolean} shown @param {boolean} faded */
  show(shown, faded) {
    this.mesh.visible = shown;
    this.material.transparent = faded;
    this.material.opacity = faded ? FADED : 1;
    this.material.depthWrite = !faded;
  }
}

class Stage {
  /** @param {HTMLCanvasElement} canvas @param {Replay} replay @param {House | null} house @param {Packed} person */
  static async of(canvas, replay, house, person) {
    const stage = new Stage(canvas, replay, new Skin(await unpack(person), replay.looks[0]));
    if (house) await stage.furnish(house);
    else stage.scene.add(new THREE.GridHelper(40, 40, 0x888888, 0xcccccc));
    await stage.load();
    return stage;
  }

  /** @param {HTMLCanvasElement} canvas @param {Replay} replay @param {Skin} skin */
  constructor(canvas, replay, skin) {
    this.canvas = canvas;
    this.replay = replay;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.03, 120);
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.outputEncoding = THREE.sRGBEncoding;
    const sun = new THREE.DirectionalLight(0xffffff, 0.55);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb8b0a4, 0.75), sun, sun.target);
    this.sun = sun;
    this.shade();
    /** @type {Furnishing[]} */
    this.furnishings = [];
    /** @type {View} */
    this.view = "follow";
    this.time = 0;
    const [azimuth, elevation] = replay.camera;
    this.around = { azimuth, elevation, distance: 3.6 };
    this.centre = new THREE.Vector3();
    this.marks = true;
    this.cut = true;
    this.skin = skin;
    this.body = new Figure(replay.body, skin, new THREE.MeshLambertMaterial({ vertexColors: true }));
    this.body.mesh.castShadow = this.body.mesh.receiveShadow = true;
    this.ghost = new Figure(replay.body, skin, new THREE.MeshLambertMaterial({ color: 0x20b090, transparent: true, opacity: 0.35, depthWrite: false }));
    this.ghost.root.visible = false;
    /** @type {Figure[]} The other bodies in the scene. */
    this.people = [];
    this.line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xd4488f }));
    this.scene.add(this.body.root, this.ghost.root, this.line, ...replay.targets.map(outline));
    /** @type {Record<string, Values>} */
    this.motion = {};
    /** @type {number[]} */
    this.heading = [];
  }

  /** Shadows of the body and of furniture, in a square of 8 metres around the body. */
  shade() {
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.normalBias = 0.03;
    Object.assign(this.sun.shadow.camera, { left: -4, right: 4, top: 4, bottom: -4, near: 0.5, far: 14 });
  }

  /** Prepare the motion of the replay. */
  async load() {
    this.motion = await unpack(this.replay.motion);
    this.people = Object.keys(this.motion).filter((name) => /^person\d+_root$/.test(name)).map((_, number) => {
      const other = new Figure(this.replay.body, this.skin.worn(this.replay.looks[number + 1]), new THREE.MeshLambertMaterial({ vertexColors: true }));
      other.mesh.castShadow = other.mesh.receiveShadow = true;
      this.scene.add(other.root);
      return other;
    });
    this.heading = this.headings();
    this.trace();
  }

  /** @param {House} house */
  async furnish(house) {
    const meshes = await unpack(house.meshes);
    const textures = await Promise.all(house.pictures.map((uri) => new THREE.TextureLoader().loadAsync(uri)));
    for (const texture of textures) texture.encoding = THREE.sRGBEncoding;
    const shapes = house.assets.map((asset) => shapeOf(asset, meshes));
    for (const data of house.objects) {
      const map = textures[house.assets[data.asset].picture];
      const material = new THREE.MeshLambertMaterial({ map, side: THREE.DoubleSide });
      const mesh = new THREE.Mesh(shapes[data.asset], material);
      mesh.position.fromArray(data.place);
      mesh.quaternion.fromArray(data.place, 3);
      mesh.castShadow = data.kind === "furniture" && data.box[0][1] < this.floor(data.box[0][1] + 0.3) + 1.8;
      mesh.receiveShadow = true;
      this.scene.add(mesh);
      this.furnishings.push(new Furnishing(data, mesh));
    }
    for (const wall of this.furnishings.filter(({ data }) => data.kind === "wall")) wall.hung = this.hangings(wall);
  }

  /** The point that the camera looks at: above the hips. @param {number} time */
  chest(time) {
    const root = this.motion.simulated_root;
    const [frame, next, share] = between(time, root.length / 3);
    return mixed(root, frame, next, share, 3).add(new THREE.Vector3(0, 0.12, 0));
  }

  /** Objects that hang on a wall: they touch the wall and stand on no floor. @param {Furnishing} wall */
  hangings(wall) {
    const around = wall.box.clone().expandByScalar(0.05);
    const above = (/** @type {THREE.Box3} */ { min }) => this.replay.floors.every((floor) => min.y < floor - 0.05 || min.y > floor + 0.3);
    return this.furnishings.filter((other) => !["wall", "floor", "stairs"].includes(other.data.kind) && around.intersectsBox(other.box) && above(other.box));
  }

  /** Draw the walked path, 3 cm above the floor. */
  trace() {
    const root = this.motion.simulated_root;
    const points = [];
    for (let k = 0; k < root.length; k += 3) points.push(new THREE.Vector3(root[k], this.floor(root[k + 1]) + 0.03, root[k + 2]));
    this.line.geometry = new THREE.BufferGeometry().setFromPoints(points);
  }

  /** The floor below a pelvis at this height. @param {number} height */
  floor(height) {
    return this.replay.floors.filter((floor) => floor < height - 0.2).pop() ?? this.replay.floors[0];
  }

  /** Heading of the body in every frame, smoothed, so that a camera behind it does not shake. */
  headings() {
    const turns = this.motion.simulated_turns;
    const count = this.replay.frames;
    const joints = this.replay.body.offsets.length;
    const facing = Array.from({ length: count }, (_, frame) => {
      const [x, y, z, w] = [0, 1, 2, 3].map((k) => turns[4 * joints * frame + k] / 32767);
      return [2 * (x * z + w * y), 1 - 2 * (x * x + y * y)];
    });
    const reach = Math.round(1.2 * this.replay.fps);
    return facing.map((_, frame) => {
      const near = facing.slice(Math.max(0, frame - reach), frame + reach + 1);
      return Math.atan2(near.reduce((sum, f) => sum + f[0], 0), near.reduce((sum, f) => sum + f[1], 0));
    });
  }

  /** Draw a moment. @param {number} time in frames of the replay */
  draw(time) {
    this.time = time;
    this.body.pose(this.motion.simulated_root, this.motion.simulated_turns, time);
    this.ghost.pose(this.motion.generated_root, this.motion.generated_turns, time);
    this.people.forEach((other, number) => other.pose(this.motion[`person${number}_root`], this.motion[`person${number}_turns`], time));
    this.skin.mark(new Set(this.marks ? this.touching(time).map(([, , joint]) => joint) : []));
    for (const furnishing of this.furnishings) this.move(furnishing, time);
    this.body.root.updateMatrixWorld(true);
    this.aim(time);
    this.clear();
    this.resize();
    this.renderer.setClearColor(getComputedStyle(this.canvas).getPropertyValue("--sky").trim() || "#dfe9f2");
    this.renderer.render(this.scene, this.camera);
  }

  /** @param {number} time */
  touching(time) {
    return this.replay.contacts.filter(([first, last]) => first - 0.5 <= time && time <= last + 0.5);
  }

  /** @param {Furnishing} furnishing @param {number} time */
  move({ data, mesh, box }, time) {
    const path = this.motion[`object_${data.id}`];
    if (!path) return;
    const [frame, next, share] = between(time, path.length / 7);
    mesh.position.copy(mixed(path, frame, next, share, 7));
    mesh.quaternion.set(path[7 * frame + 3], path[7 * frame + 4], path[7 * frame + 5], path[7 * frame + 6]);
    box.setFromObject(mesh);
  }

  /** @param {number} time */
  aim(time) {
    const pelvis = this.body.joints[0].position;
    this.ego = this.view === "ego";
    this.body.fold(this.ego);
    this.sun.target.position.copy(pelvis);
    this.sun.position.set(2, 6, 3).add(pelvis);
    this.camera.fov = 60;
    this.camera.up.set(0, 1, 0);
    if (this.ego) return this.lookOut();
    if (this.view !== "free") this.centre.copy(this.chest(time));
    this.camera.position.copy(this.orbit(time));
    this.camera.lookAt(this.centre);
  }

  /** The camera's place on its sphere around the centre. @param {number} time */
  orbit(time) {
    const heading = this.view === "follow" ? this.heading[Math.round(time)] ?? 0 : 0;
    const { azimuth, elevation, distance } = this.around;
    const steep = this.view === "above" ? 1.45 : elevation;
    const far = this.view === "above" ? 2.2 * distance : distance;
    const angle = azimuth + heading;
    const flat = Math.cos(steep) * far;
    return new THREE.Vector3(Math.sin(angle) * flat, Math.sin(steep) * far, Math.cos(angle) * flat).add(this.centre);
  }

  /** Look from the eyes, with a level head, as in the recorded views. */
  lookOut() {
    const head = this.body.joints[HEAD];
    const facing = new THREE.Vector3(0, 0, 1).transformDirection(head.matrixWorld);
    const eye = head.localToWorld(new THREE.Vector3(0, 0.08, this.replay.body.gaze.ahead));
    const level = Math.atan2(facing.x, facing.z);
    const forward = new THREE.Vector3(Math.sin(level), Math.tan(this.replay.body.gaze.pitch), Math.cos(level));
    this.camera.fov = 90;
    this.camera.position.copy(eye);
    this.camera.lookAt(eye.add(forward));
  }

  /** Hide objects above the body, and fade those between it and the camera. */
  clear() {
    const pelvis = this.body.joints[0].position;
    const top = this.floor(pelvis.y) + STOREY;
    const points = [pelvis, this.body.place(HEAD)];
    points.push(new THREE.Vector3(pelvis.x, this.floor(pelvis.y) + 0.15, pelvis.z));
    const cutting = (this.cut || this.view === "above") && !this.ego;
    const between = this.furnishings.filter((one) => cutting && this.fades(one, points));
    const faded = new Set([...between, ...between.flatMap((one) => one.hung)]);
    for (const furnishing of this.furnishings) furnishing.show(!cutting || furnishing.box.min.y <= top, faded.has(furnishing));
  }

  /** @param {Furnishing} furnishing @param {THREE.Vector3[]} points */
  fades({ data, box }, points) {
    return data.kind !== "floor" && data.kind !== "stairs" && points.some((point) => hides(box, this.camera.position, point));
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = Math.min(window.devicePixelRatio, 2);
    this.renderer.setPixelRatio(ratio);
    if (this.canvas.width !== Math.floor(width * ratio) || this.canvas.height !== Math.floor(height * ratio)) this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }

  /** Turn and tilt the camera around what it looks at, radians. @param {number} azimuth @param {number} elevation */
  turn(azimuth, elevation) {
    this.around.azimuth += azimuth;
    this.around.elevation = Math.max(-0.1, Math.min(1.5, this.around.elevation + elevation));
  }

  /** @param {number} factor */
  zoom(factor) {
    this.around.distance = Math.max(0.8, Math.min(25, this.around.distance * factor));
  }
}

/** @param {AssetData} asset @param {Record<string, ArrayLike<number> & {slice(a: number, b: number): any}>} meshes */
function shapeOf(asset, meshes) {
  const [a, b] = asset.vertices;
  const [c, d] = asset.faces;
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(meshes.vertices.slice(3 * a, 3 * b), (mm) => mm / 1000), 3));
  shape.setAttribute("uv", new THREE.BufferAttribute(meshes.uv.slice(2 * a, 2 * b), 2, true));
  shape.setIndex(new THREE.BufferAttribute(meshes.faces.slice(3 * c, 3 * d), 1));
  const flat = shape.toNonIndexed(); // Triangles share no vertices, so that normals do not round off edges.
  flat.computeVertexNormals();
  return flat;
}

/** Whether a box is between the eye and a point. @param {THREE.Box3} box @param {THREE.Vector3} eye @param {THREE.Vector3} point */
function hides(box, eye, point) {
  const ray = new THREE.Ray(eye, point.clone().sub(eye).normalize());
  const hit = ray.intersectBox(box, new THREE.Vector3());
  return hit !== null && !box.containsPoint(point) && hit.distanceTo(eye) < eye.distanceTo(point) - 0.05;
}

/** The outline of a target's box. @param {number[][]} corners */
function outline([low, high]) {
  const box = new THREE.Box3(new THREE.Vector3().fromArray(low), new THREE.Vector3().fromArray(high));
  return new THREE.Box3Helper(box, new THREE.Color(0x1fa060));
}

/** Turn the camera with the pointer or the arrow keys; zoom with a pinch, the wheel, + and -. @param {Stage} stage @param {() => void} draw */
function drag(stage, draw) {
  const canvas = stage.canvas;
  /** @type {Map<number, PointerEvent>} */
  const held = new Map();
  const spread = () => {
    const [a, b] = [...held.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, event);
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = held.get(event.pointerId);
    if (!last) return;
    const wide = held.size === 2 ? spread() : 0;
    held.set(event.pointerId, event);
    if (held.size === 2) stage.zoom(wide / Math.max(1, spread()));
    else stage.turn((last.clientX - event.clientX) / 150, (event.clientY - last.clientY) / 150);
    draw();
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(/** @type {PointerEvent} */ (event).pointerId));
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return; // The page scrolls until the replay has the focus.
    event.preventDefault();
    stage.zoom(Math.exp(event.deltaY / 600));
    draw();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    /** @type {Record<string, () => void>} */
    const acts = {
      ArrowLeft: () => stage.turn(-0.1, 0),
      ArrowRight: () => stage.turn(0.1, 0),
      ArrowUp: () => stage.turn(0, 0.08),
      ArrowDown: () => stage.turn(0, -0.08),
      "+": () => stage.zoom(0.9),
      "-": () => stage.zoom(1.1),
    };
    if (!acts[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    acts[event.key]();
    draw();
  });
}
