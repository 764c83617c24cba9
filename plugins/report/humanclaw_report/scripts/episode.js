// The player of an episode: view, replay, map, chart and the list of calls show the same moment.
// @ts-check
/// <reference path="viewer.js" />
"use strict";

/** @typedef {{at: number, picture: string}[]} OtherViews */
/** @typedef {{step: number, first: number, end: number, frame: string, call: string, words: string, touches: string, distance: number | null}} Moment */

const find = (/** @type {string} */ id) => /** @type {HTMLElement} */ (document.getElementById(id));
const read = (/** @type {string} */ id) => JSON.parse(find(id).textContent ?? "null");

class Player {
  /** @param {Moment[]} moments @param {OtherViews[]} others @param {number} frames @param {number} fps @param {Stage | null} stage */
  constructor(moments, others, frames, fps, stage) {
    this.moments = moments;
    this.others = others;
    this.frames = frames;
    this.fps = fps;
    this.stage = stage;
    this.time = 0;
    this.playing = false;
    this.speed = 1;
    this.shown = -1;
    this.before = 0;
    this.addressing = 0;
    this.slider = /** @type {HTMLInputElement} */ (find("time"));
    this.rows = [...document.querySelectorAll("#calls > li")];
    this.markers = [.../** @type {NodeListOf<SVGGElement>} */ (document.querySelectorAll(".now"))];
    this.cursors = [.../** @type {NodeListOf<SVGLineElement>} */ (document.querySelectorAll(".cursor"))];
  }

  /** Index of the last step that has begun. */
  get current() {
    const begun = this.moments.filter((moment) => Math.min(moment.first, this.frames - 1) <= this.time + 1e-6);
    return Math.max(0, begun.length - 1);
  }

  /** @param {number} time in frames */
  seek(time) {
    this.time = Math.max(0, Math.min(time, this.frames - 1));
    this.slider.value = String(this.time);
    this.draw();
    this.address();
  }

  /** Point the page's address to this moment. Wait until the time rests, since browsers limit address changes per second. */
  address() {
    clearTimeout(this.addressing);
    if (this.playing) return;
    const moment = this.moments[this.current];
    const exact = moment && Math.abs(this.time - moment.first) < 1e-6;
    const hash = exact ? `#step=${moment.step}` : `#t=${(this.time / this.fps).toFixed(2)}`;
    this.addressing = setTimeout(() => history.replaceState(null, "", hash), 250);
  }

  /** @param {number} index */
  jump(index) {
    const held = Math.max(0, Math.min(index, this.moments.length - 1));
    this.seek(this.moments[held]?.first ?? 0);
  }

  /** @param {boolean} on */
  play(on) {
    if (on && this.time >= this.frames - 1) this.time = 0;
    this.playing = on;
    find("play").textContent = on ? "Pause" : "Play";
    find("play").setAttribute("aria-pressed", String(on));
    this.before = performance.now();
    if (on) requestAnimationFrame((now) => this.tick(now));
    this.address();
  }

  /** @param {number} now */
  tick(now) {
    if (!this.playing) return;
    this.seek(this.time + ((now - this.before) / 1000) * this.fps * this.speed);
    this.before = now;
    if (this.time >= this.frames - 1) this.play(false);
    else requestAnimationFrame((later) => this.tick(later));
  }

  draw() {
    const index = this.current;
    if (index !== this.shown) this.tell(index);
    const seconds = this.time / this.fps;
    find("clock").textContent = `${seconds.toFixed(1)} of ${((this.frames - 1) / this.fps).toFixed(1)} s`;
    this.slider.setAttribute("aria-valuetext", `${seconds.toFixed(1)} seconds, step ${this.moments[index]?.step ?? 0}`);
    const share = this.frames > 1 ? (100 * this.time) / (this.frames - 1) : 0;
    for (const cursor of this.cursors) cursor.setAttribute("transform", `translate(${share} 0)`);
    if (this.stage) this.stage.draw(this.time);
    this.mark();
    this.others.forEach((views, number) => this.look(views, /** @type {HTMLImageElement} */ (find(`other${number}`))));
  }

  /** Show what another body saw last. @param {OtherViews} views @param {HTMLImageElement} image */
  look(views, image) {
    const { picture } = views.filter(({ at }) => at <= this.time + 1e-6).pop() ?? views[0];
    if (image.getAttribute("src") !== picture) image.src = picture;
  }

  /** Show a step's view and words. @param {number} index */
  tell(index) {
    this.shown = index;
    const moment = this.moments[index];
    if (!moment) return;
    const row = this.rows[index];
    const picture = /** @type {HTMLImageElement} */ (find("ego"));
    const thumb = /** @type {HTMLImageElement | null} */ (row?.querySelector("img"));
    picture.hidden = !thumb;
    if (thumb) picture.src = thumb.src;
    picture.alt = `Ego view before step ${moment.step}`;
    find("step-now").textContent = `Step ${moment.step} of ${this.moments[this.moments.length - 1].step}`;
    find("call-now").textContent = moment.call;
    find("words-now").textContent = moment.words;
    find("touch-now").textContent = moment.touches ? `In contact: ${moment.touches}` : "";
    find("distance-now").textContent = moment.distance === null ? "" : `${moment.distance.toFixed(2)} m`;
    this.rows.forEach((other, k) => (k === index ? other.setAttribute("aria-current", "step") : other.removeAttribute("aria-current")));
    this.follow(row);
  }

  /** Scroll the list to the row, without scrolling the page. @param {Element | undefined} row */
  follow(row) {
    const list = find("calls");
    if (!(row instanceof HTMLElement) || list.scrollHeight <= list.clientHeight) return;
    list.scrollTop = row.offsetTop - list.offsetTop - list.clientHeight / 3;
  }

  /** Move the marker to the body's place on the map of its storey. */
  mark() {
    const root = this.stage?.motion.simulated_root;
    if (!root || !this.stage) return;
    const [frame, next, share] = between(this.time, root.length / 3);
    const place = mixed(root, frame, next, share, 3);
    const heading = this.stage.heading[frame] ?? 0;
    const heights = this.markers.map((marker) => Number(marker.dataset.floor));
    const under = Math.max(...heights.filter((floor) => floor <= place.y + 0.1), Math.min(...heights));
    for (const marker of this.markers) {
      marker.toggleAttribute("hidden", Number(marker.dataset.floor) !== under);
      marker.style.display = Number(marker.dataset.floor) === under ? "" : "none";
      const bearing = 180 - (heading * 180) / Math.PI;
      marker.setAttribute("transform", `translate(${100 * place.x} ${100 * place.z}) rotate(${bearing}) scale(${marker.dataset.scale})`);
    }
  }

  /** Follow a link to a moment: #step=12 or #t=6.5 (seconds). */
  visit() {
    const [, kind, value] = /^#(step|t)=(\d+(?:\.\d+)?)$/.exec(location.hash) ?? [];
    if (kind === "t") this.seek(Number(value) * this.fps);
    if (kind === "step") this.jump(this.moments.findIndex((moment) => moment.step === Number(value)));
  }
}

/** @param {Player} player */
function connect(player) {
  const press = (/** @type {string} */ id, /** @type {() => void} */ act) => find(id).addEventListener("click", act);
  press("play", () => player.play(!player.playing));
  press("back", () => player.jump(player.current - 1));
  press("next", () => player.jump(player.current + 1));
  player.slider.addEventListener("input", () => player.seek(Number(player.slider.value)));
  const rate = /** @type {HTMLSelectElement} */ (find("rate"));
  rate.addEventListener("change", () => (player.speed = Number(rate.value)));
  window.addEventListener("hashchange", () => player.visit());
  window.addEventListener("resize", () => player.draw());
  document.addEventListener("keydown", (event) => key(event, player));
}

/** @param {KeyboardEvent} event @param {Player} player */
function key(event, player) {
  // A focused control keeps the keys that it handles itself: a slider all but the brackets, a button the space bar.
  const inside = (/** @type {string} */ kinds) => event.target instanceof Element && event.target.closest(kinds);
  const taken = inside("input[type=range], select, video") ? !["[", "]"].includes(event.key) : event.key === " " && inside("input, button, a, summary");
  if (event.ctrlKey || event.metaKey || event.altKey || taken) return;
  /** @type {Record<string, () => void>} */
  const acts = {
    " ": () => player.play(!player.playing),
    ArrowLeft: () => player.seek(player.time - player.fps / 5),
    ArrowRight: () => player.seek(player.time + player.fps / 5),
    "[": () => player.jump(player.current - 1),
    "]": () => player.jump(player.current + 1),
    Home: () => player.seek(0),
    End: () => player.seek(player.frames - 1),
  };
  if (!acts[event.key]) return;
  event.preventDefault();
  acts[event.key]();
}

/** @param {Player} player @param {Stage} stage */
function steer(player, stage) {
  const view = /** @type {HTMLSelectElement} */ (find("view"));
  view.addEventListener("change", () => {
    stage.view = /** @type {View} */ (view.value);
    player.draw();
  });
  for (const [id, set] of /** @type {[string, (on: boolean) => void][]} */ ([
    ["ghost", (on) => (stage.ghost.root.visible = on)],
    ["marks", (on) => (stage.marks = on)],
    ["cut", (on) => (stage.cut = on)],
  ])) {
    const box = /** @type {HTMLInputElement} */ (find(id));
    box.addEventListener("change", () => {
      set(box.checked);
      player.draw();
    });
  }
  drag(stage, () => player.draw());
}

/** @param {Replay | null} replay */
async function stageOf(replay) {
  const canvas = /** @type {HTMLCanvasElement} */ (find("stage"));
  try {
    if (!replay || typeof THREE === "undefined") throw new Error("The record of this episode holds no motion.");
    const { humanclawHouse, humanclawSkin } = /** @type {any} */ (window);
    return await Stage.of(canvas, replay, humanclawHouse ?? null, humanclawSkin);
  } catch (fault) {
    // Without WebGL or motion, the page still shows views, words, map and chart.
    canvas.hidden = true;
    find("no-stage").textContent = `No 3D replay: ${fault instanceof Error ? fault.message : fault}`;
    find("steering").hidden = true;
    return null;
  }
}

async function main() {
  const replay = /** @type {Replay | null} */ (read("replay"));
  const moments = /** @type {Moment[]} */ (read("moments"));
  const frames = replay?.frames ?? Math.max(1, Math.ceil(moments[moments.length - 1]?.end ?? 1));
  const stage = await stageOf(replay);
  const player = new Player(moments, read("others"), frames, replay?.fps ?? 15, stage);
  player.slider.max = String(frames - 1);
  connect(player);
  if (stage) steer(player, stage);
  player.draw();
  player.visit();
  document.documentElement.dataset.ready = stage ? "3d" : "flat";
}

main();
