// The camera: its own way around the body, from inside the room and never behind a wall, and hands that take it over.
// @ts-check
/// <reference path="viewer.js" />
"use strict";

const WANTED = 3.2; // Distance to the body where there is room, metres.
const MARGIN = 0.15; // Distance that the camera keeps from what is behind it, metres.
const LEAST = 1.2; // The camera leaves its way rather than come closer, metres.
const USED = 0.4; // Furniture as near as this to the chest is what the body uses, and lower than its box, metres.
const EVERY_KEY = 6; // Frames of the replay between two choices of a direction.
const WAYS = [0.12, 0.42, 0.75].flatMap((elevation) =>
  Array.from({ length: 16 }, (_, k) => ({ elevation, azimuth: (k * Math.PI) / 8 })),
).map(({ elevation, azimuth }) => ({
  elevation,
  azimuth,
  way: new THREE.Vector3(Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation), Math.cos(elevation) * Math.cos(azimuth)),
}));

/** Distance along a ray to the nearest box in its way. @param {THREE.Vector3} start @param {THREE.Vector3} way @param {THREE.Box3[]} boxes @param {number} most */
function clear(start, way, boxes, most) {
  const ray = new THREE.Ray(start, way);
  const hit = new THREE.Vector3();
  let found = most;
  for (const box of boxes) {
    if (ray.intersectBox(box, hit)) found = Math.min(found, hit.distanceTo(start));
  }
  return found;
}

/** Where the camera stands in every frame, as an offset from the body's chest. */
class Way {
  /** sides: where from straight ahead of the body it is best seen, radians. @param {THREE.Vector3[]} chests @param {number[]} headings @param {number[]} sides @param {THREE.Box3[]} walls @param {THREE.Box3[]} furniture */
  constructor(chests, headings, sides, walls, furniture = []) {
    this.walls = walls;
    this.furniture = furniture;
    const keys = chests.map((_, k) => k).filter((k) => k % EVERY_KEY === 0);
    const scored = keys.map((k) => Way.scores(chests[k], headings[k], sides[k], this.near(chests[k])));
    const chosen = Way.cheapest(scored.map((one) => one.map(({ cost }) => cost)));
    /** @type {THREE.Vector3[]} */
    this.offsets = chosen.map((state, k) => WAYS[state].way.clone().multiplyScalar(scored[k][state].reach));
  }

  /** What may stand between the chest and a camera. @param {THREE.Vector3} chest */
  near(chest) {
    const within = (/** @type {THREE.Box3[]} */ boxes, /** @type {number} */ least) =>
      boxes.filter((box) => box.distanceToPoint(chest) > least && box.distanceToPoint(chest) < WANTED + MARGIN);
    return [...within(this.walls, 0), ...within(this.furniture, USED)];
  }

  /** Cost of each direction, and how far away the camera can stand. @param {THREE.Vector3} chest @param {number} heading @param {number} side @param {THREE.Box3[]} near */
  static scores(chest, heading, side, near) {
    return WAYS.map(({ elevation, azimuth, way }) => {
      const reach = clear(chest, way, near, WANTED + MARGIN) - MARGIN;
      const aside = Math.abs(Math.cos(azimuth - heading) - Math.cos(side));
      return { reach: Math.max(reach, 0.3), cost: 8 * (1 - Math.min(1, reach / WANTED)) ** 2 + 0.5 * aside + 0.6 * Math.abs(elevation - 0.42) };
    });
  }

  /** The states of least total cost (Viterbi). @param {number[][]} costs */
  static cheapest(costs) {
    const change = WAYS.map((one) => WAYS.map((other) => 1.5 * one.way.angleTo(other.way)));
    let total = costs[0];
    const back = costs.slice(1).map((row) => {
      const came = row.map((_, to) => total.reduce((best, cost, from) => (cost + change[from][to] < total[best] + change[best][to] ? from : best), 0));
      total = row.map((cost, to) => cost + total[came[to]] + change[came[to]][to]);
      return came;
    });
    if (!total) return [];
    const states = [total.indexOf(Math.min(...total))];
    for (const came of back.reverse()) states.push(came[states[states.length - 1]]);
    return states.reverse();
  }

  /** The camera's place. @param {THREE.Vector3} chest @param {number} time */
  at(chest, time) {
    // A mean over two seconds: the camera glides from one direction to the next.
    const offset = new THREE.Vector3();
    let weight = 0;
    this.offsets.forEach((one, k) => {
      const share = Math.exp(-(((k * EVERY_KEY - time) / 10) ** 2));
      offset.addScaledVector(one, share);
      weight += share;
    });
    offset.divideScalar(Math.max(weight, 1e-9));
    const near = this.near(chest);
    const wanted = Math.max(offset.length(), LEAST);
    const reach = (/** @type {THREE.Vector3} */ way) => Math.min(wanted, clear(chest, way, near, 9) - MARGIN);
    const ways = [offset.clone().normalize()];
    // Between two good directions may stand a wall: then the nearest direction that has room.
    if (reach(ways[0]) < LEAST) ways.push(...WAYS.map(({ way }) => way).sort((a, b) => a.angleTo(ways[0]) - b.angleTo(ways[0])));
    const way = ways.find((one) => reach(one) >= LEAST) ?? ways.reduce((best, one) => (reach(one) > reach(best) ? one : best));
    return chest.clone().addScaledVector(way, Math.max(0.3, reach(way)));
  }
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
