// The live page of a run: shows each state that the server sends.
// @ts-check
"use strict";

{
  /** @typedef {{id: string, instruction: string, outcome: string, goal: string, steps: number, call: string, words: string, distance: number | null, frame: string, replay: string}} Row */
  /** @typedef {{ended: number, episodes: number, asked: number, rows: Row[], live: number}} State */

  const at = (/** @type {string} */ id) => /** @type {HTMLElement} */ (document.getElementById(id));

  /** @param {string} tag @param {string} text @param {string} [kind] */
  const made = (tag, text, kind = "") => {
    const element = document.createElement(tag);
    element.textContent = text;
    element.className = kind;
    return element;
  };

  const linked = (/** @type {string} */ text, /** @type {string} */ href) => Object.assign(made("a", text), { href, target: "_blank" });

  const ending = (/** @type {Row} */ row) => [row.outcome.replaceAll("_", " "), row.goal].filter(Boolean).join(", ");

  /** @param {Row} row */
  const line = (row) => {
    const cells = [made("th", row.id), made("td", ending(row)), made("td", String(row.steps), "num"), made("td", row.call)];
    cells[0].setAttribute("scope", "row");
    if (row.replay) cells[0].replaceChildren(linked(row.id, row.replay));
    const element = document.createElement("tr");
    element.append(...cells, made("td", row.distance === null ? "" : `${row.distance.toFixed(2)} m`, "num"));
    return element;
  };

  /** Return the card of an episode; make it at the first call. @param {Row} row */
  const card = (row) => {
    const known = document.querySelector(`[data-episode="${CSS.escape(row.id)}"]`);
    if (known instanceof HTMLElement) return known;
    const element = made("article", "", "card");
    element.dataset.episode = row.id;
    const picture = document.createElement("img");
    picture.width = picture.height = 512;
    element.append(made("h3", `${row.id}: ${row.instruction}`), made("p", "", "said"), picture);
    return element;
  };

  /** @param {Row} row */
  const show = (row) => {
    const element = card(row);
    const picture = /** @type {HTMLImageElement} */ (element.querySelector("img"));
    picture.alt = `What the body sees after ${row.steps} step${row.steps === 1 ? "" : "s"}`;
    if (row.frame && !picture.src.endsWith(row.frame)) picture.src = row.frame;
    const said = /** @type {HTMLElement} */ (element.querySelector(".said"));
    said.textContent = row.steps ? `Step ${row.steps - 1}, ${row.call}${row.words && `: ${row.words}`}` : "";
    if (row.outcome !== "running") said.append(` Then it ended: ${ending(row)}. `);
    if (row.replay) said.append(linked("Watch the replay", row.replay));
    return element;
  };

  const events = new EventSource("/events");
  events.onmessage = (event) => {
    const state = /** @type {State} */ (JSON.parse(event.data));
    const of = state.asked ? ` of ${state.asked}` : "";
    at("lede").textContent = !state.episodes ? "No episode has begun." : `${state.ended}${of} ended, ${state.episodes - state.ended} in progress.`;
    const { rows } = state;
    at("rows").replaceChildren(...rows.map(line));
    const running = rows.filter((row) => row.outcome === "running");
    const live = (running.length ? running : rows).slice(0, running.length ? state.live : 1);
    at("now").textContent = live.length && !running.length ? "Last episode" : "Now";
    at("live").replaceChildren(...live.map(show));
    document.documentElement.dataset.ready = "yes";
  };
  events.onerror = () => (at("lede").textContent = "The server has stopped. The records are in the folder of the run.");
}
