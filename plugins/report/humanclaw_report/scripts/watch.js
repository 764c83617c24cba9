// The live page of a run: shows each state that the server sends.
// @ts-check
"use strict";

{
  /** @typedef {{id: string, instruction: string, outcome: string, steps: number, call: string, reasoning: string, distance: number | null, frame: string, map: string, replay: string}} Row */
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

  /** @param {Row} row */
  const line = (row) => {
    const cells = [made("th", row.id), made("td", row.outcome.replace("_", " ")), made("td", String(row.steps), "num"), made("td", row.call)];
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
    picture.width = picture.height = 320;
    element.append(made("h3", `${row.id}: ${row.instruction}`), picture, made("p", "", "said"), made("div", "", "map"));
    return element;
  };

  /** Draw the path up to now. One request at a time: the first map of a house takes the server seconds. @param {HTMLElement} element */
  const draw = async (element) => {
    const map = /** @type {HTMLElement} */ (element.querySelector(".map"));
    element.dataset.drawing = "yes";
    for (let wanted = element.dataset.map; map.dataset.shown !== wanted; wanted = element.dataset.map) {
      const answer = await fetch(wanted ?? "").catch(() => null);
      if (!answer?.ok) break;
      map.innerHTML = await answer.text();
      map.dataset.shown = wanted;
    }
    delete element.dataset.drawing;
  };

  /** @param {Row} row */
  const show = (row) => {
    const element = card(row);
    const picture = /** @type {HTMLImageElement} */ (element.querySelector("img"));
    picture.alt = `What the body sees after ${row.steps} step${row.steps === 1 ? "" : "s"}`;
    if (row.frame && !picture.src.endsWith(row.frame)) picture.src = row.frame;
    const said = /** @type {HTMLElement} */ (element.querySelector(".said"));
    said.textContent = row.steps ? `Step ${row.steps - 1}, ${row.call}: ${row.reasoning}` : "";
    if (row.replay) said.append(" ", linked("Watch the replay", row.replay));
    element.dataset.map = row.map;
    if (!element.dataset.drawing) draw(element);
    return element;
  };

  const events = new EventSource("/events");
  events.onmessage = (event) => {
    const state = /** @type {State} */ (JSON.parse(event.data));
    const of = state.asked ? ` of ${state.asked}` : "";
    at("lede").textContent = !state.episodes ? "No episode has begun." : `${state.ended}${of} ended, ${state.episodes - state.ended} in progress.`;
    at("rows").replaceChildren(...state.rows.map(line));
    const running = state.rows.filter((row) => row.outcome === "running");
    const live = (running.length ? running : state.rows).slice(0, running.length ? state.live : 1);
    at("now").textContent = live.length && !running.length ? "Last episode" : "Now";
    at("live").replaceChildren(...live.map(show));
    document.documentElement.dataset.ready = "yes";
  };
  events.onerror = () => (at("lede").textContent = "The server has stopped. The records are in the folder of the run.");
}
